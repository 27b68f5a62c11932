// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// JobQueue: taking jobs, doing them, and writing down what becomes of them.
#include <algorithm>
#include <exception>

#include <spdlog/spdlog.h>

#include "descriptor/base/error.h"
#include "descriptor/base/unix_time.h"
#include "server/jobs/job_record.h"
#include "server/jobs/jobs.h"

namespace pliant::server {

namespace {

constexpr int kUnavailable = 503;

}  // namespace

std::shared_ptr<JobQueue::Job> JobQueue::TakeNext(const std::string& kind) {
  const auto next = std::find_if(queue_.begin(), queue_.end(),
                                 [&](const auto& job) { return job->status.kind == kind; });
  if (next == queue_.end()) return nullptr;
  const std::shared_ptr<Job> job = *next;
  queue_.erase(next);
  return job;
}

void JobQueue::Run(const std::string& kind) {
  while (true) {
    std::shared_ptr<Job> job;
    JobStatus begun;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return stopping_ || (job = TakeNext(kind)) != nullptr; });
      if (stopping_) return;  // a job that was just taken stays queued in the store
      job->begun = true;
      job->status.state = JobState::kRunning;
      ++job->status.attempts;
      begun = job->status;
    }
    Become(*job, std::move(begun));
    if (IsOwn(*job)) Execute(job);
  }
}

bool JobQueue::IsOwn(const Job& job) const {
  const std::lock_guard lock(mutex_);
  return job.owner == owner_;
}

// A row that cannot be written at once is left for the next time.
void JobQueue::OnProgress(Job& job, double done, double total) {
  const auto now = std::chrono::steady_clock::now();
  {
    const std::lock_guard lock(mutex_);
    job.status.done = done;
    job.status.total = total;
    if (now - job.saved < kSaveEvery) return;
  }
  const std::unique_lock saving(saving_, std::try_to_lock);
  if (!saving) return;
  JobStatus status;
  {
    const std::lock_guard lock(mutex_);
    job.saved = now;
    status = job.status;
  }
  Save(job, status);
}

void JobQueue::Execute(const std::shared_ptr<Job>& job) {
  const JobContext context(
      job->stop.get_token(),
      [this, &job](double done, double total) { OnProgress(*job, done, total); },
      [this, &job](const SkippedItem& item) {
        const std::lock_guard lock(mutex_);
        ++job->status.failed;
        if (job->status.skipped.size() < kMaxSkipped) job->status.skipped.push_back(item);
      });
  JobStatus status;
  {
    const std::lock_guard lock(mutex_);
    job->status.failed = 0;  // of an attempt before
    job->status.skipped.clear();
    status = job->status;
  }
  std::string result;
  std::optional<Problem> problem;
  bool stopped = false;
  try {
    result = kinds_.at(status.kind).run(status, context);
  } catch (const Error& error) {
    stopped = error.code() == ErrorCode::kCancelled;
    problem = CurrentProblem();
  } catch (...) {
    problem = CurrentProblem();
  }
  const bool again = problem && problem->status == kUnavailable && MayGoOn(status);
  if (again) AwaitStore(job->stop.get_token());
  if (!IsOwn(*job)) return;  // what becomes of it is the other server's to say
  bool cancelled = false;
  bool stopping = false;
  {
    const std::lock_guard lock(mutex_);
    status = job->status;
    cancelled = job->cancelled;
    stopping = stopping_;
  }
  if (!problem) {
    status.result = result;
    status.done = status.total;
    status.state = JobState::kDone;
  } else if (cancelled && (stopped || again)) {
    status.state = JobState::kCancelled;
  } else if (stopping && (stopped || again || problem->code == "stopping")) {
    --status.attempts;  // it was not the job's fault
    status.state = JobState::kQueued;
  } else if (again) {
    spdlog::warn("job {} ({}) begins again: {} {}", status.id, status.kind, problem->code,
                 problem->internal);
    status.state = JobState::kQueued;
  } else {
    spdlog::error("job {} ({}) failed: {} {} {}", status.id, status.kind, problem->code,
                  problem->detail, problem->internal);
    status.problem = std::move(problem);
    status.state = JobState::kFailed;
  }
  Become(*job, std::move(status));
  if (!again) return;
  const std::lock_guard lock(mutex_);
  if (job->owner == owner_ && job->status.state == JobState::kQueued) queue_.push_back(job);
}

// A database server that is away would use up all attempts in no time.
void JobQueue::AwaitStore(const std::stop_token& stop) {
  while (store_ != nullptr) {
    try {
      store_->Version();
      return;
    } catch (const Error&) {
      std::unique_lock lock(mutex_);
      changed_.wait_for(lock, kLookEvery, [&] { return stopping_ || stop.stop_requested(); });
      if (stopping_ || stop.stop_requested()) return;
    }
  }
}

void JobQueue::Become(Job& job, JobStatus status) {
  const std::lock_guard saving(saving_);
  BecomeNow(job, std::move(status));
}

void JobQueue::BecomeNow(Job& job, JobStatus status) {
  if (!IsActive(status.state)) status.finished_ms = NowMs();
  Save(job, status);
  bool own = false;
  {
    const std::lock_guard lock(mutex_);
    own = job.owner == owner_;
    if (own) job.status = status;
  }
  const auto kind = kinds_.find(status.kind);
  if (own && !IsActive(status.state) && kind != kinds_.end() && kind->second.ended) {
    kind->second.ended(status);
  }
  NotifyAll();
}

// A job does its work whether or not its progress can be written down at the moment.
void JobQueue::Save(Job& job, const JobStatus& status) {
  if (store_ == nullptr) return;
  try {
    job.unsaved = true;
    const bool own = store_->SaveJob(ToRecord(status, owner_));
    job.unsaved = false;
    if (own) return;
    spdlog::warn("job {}: another server has taken it over; it ends here", status.id);
    const std::lock_guard lock(mutex_);
    job.owner.clear();  // the next look says whose it is
    job.stop.request_stop();
  } catch (const Error& error) {
    spdlog::warn("job {}: its state could not be saved: {}", status.id, error.what());
  }
}

}  // namespace pliant::server
