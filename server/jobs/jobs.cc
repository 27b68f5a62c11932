// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/jobs.h"

#include <algorithm>
#include <exception>
#include <random>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "server/jobs/job_record.h"

namespace pliant::server {

namespace {

std::int64_t NowMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

bool IsActive(JobState state) { return state == JobState::kQueued || state == JobState::kRunning; }

std::string NewId() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}", random(), random());
}

}  // namespace

std::string JobStateName(JobState state) {
  switch (state) {
    case JobState::kQueued:
      return "queued";
    case JobState::kRunning:
      return "running";
    case JobState::kDone:
      return "done";
    case JobState::kFailed:
      return "failed";
    case JobState::kCancelled:
      return "cancelled";
  }
  return "unknown";
}

JobQueue::~JobQueue() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    for (const auto& job : jobs_) job->stop.request_stop();
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void JobQueue::Register(const std::string& kind, JobKind how) {
  kinds_.emplace(kind, std::move(how));
}

void JobQueue::Start() {
  Load();
  const std::lock_guard lock(mutex_);
  for (const auto& [kind, how] : kinds_) {
    threads_.emplace_back([this, name = kind] { Run(name); });
  }
}

bool JobQueue::MayGoOn(const JobStatus& status) const {
  const auto kind = kinds_.find(status.kind);
  if (kind == kinds_.end()) return false;
  return status.state == JobState::kQueued ||
         (kind->second.resumes && status.attempts < kMaxAttempts);
}

void JobQueue::Load() {
  if (store_ == nullptr) return;
  std::vector<std::shared_ptr<Job>> lost;
  for (const JobRecord& record : store_->Jobs()) {
    auto job = std::make_shared<Job>();
    job->status = FromRecord(record);
    const std::lock_guard lock(mutex_);
    jobs_.push_back(job);
    if (!IsActive(job->status.state)) continue;
    if (!MayGoOn(job->status)) {
      lost.push_back(job);
      continue;
    }
    if (job->status.state == JobState::kRunning) {
      spdlog::info("job {} ({}) goes on", job->status.id, job->status.kind);
    }
    job->status.state = JobState::kQueued;
    queue_.push_back(job);
  }
  for (const auto& job : lost) {
    JobStatus failed = job->status;
    failed.state = JobState::kFailed;
    failed.problem =
        ProblemError("interrupted",
                     "The server ended while this ran, and it cannot go on. Start it anew.")
            .problem();
    Become(*job, std::move(failed));
  }
}

JobStatus JobQueue::Add(const std::string& kind, const std::string& collection,
                        const std::string& parameters) {
  const std::lock_guard saving(saving_);
  {
    const std::lock_guard lock(mutex_);
    if (queue_.size() >= kMaxQueued) {
      throw ProblemError("busy", "Too many jobs are waiting. Try again later.").RetryAfter(10);
    }
  }
  auto job = std::make_shared<Job>();
  job->status.id = NewId();
  job->status.kind = kind;
  job->status.collection = collection;
  job->status.parameters = parameters;
  job->status.created_ms = NowMs();
  const JobStatus added = job->status;
  if (store_ != nullptr) store_->SaveJob(ToRecord(added));  // what is promised must survive
  bool full = false;
  {
    const std::lock_guard lock(mutex_);
    jobs_.push_back(job);
    queue_.push_back(job);
    full = jobs_.size() > kMaxJobs;
    if (full) Forget();
  }
  changed_.notify_all();
  if (full && store_ != nullptr) ForgetRows();
  return added;
}

void JobQueue::ForgetRows() {
  try {
    store_->KeepNewestJobs(kMaxJobs);
  } catch (const Error& error) {
    spdlog::warn("old jobs could not be forgotten: {}", error.what());
  }
}

void JobQueue::Forget() {
  const auto oldest = std::find_if(jobs_.begin(), jobs_.end(),
                                   [](const auto& old) { return !IsActive(old->status.state); });
  if (oldest != jobs_.end()) jobs_.erase(oldest);
}

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
      job->status.state = JobState::kRunning;
      ++job->status.attempts;
      begun = job->status;
    }
    Become(*job, std::move(begun));
    Execute(job);
  }
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
  Save(status);
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
  } else if (cancelled && stopped) {
    status.state = JobState::kCancelled;
  } else if (stopping && (stopped || problem->code == "stopping")) {
    --status.attempts;  // it was not the job's fault
    status.state = JobState::kQueued;
  } else {
    spdlog::error("job {} ({}) failed: {} {} {}", status.id, status.kind, problem->code,
                  problem->detail, problem->internal);
    status.problem = std::move(problem);
    status.state = JobState::kFailed;
  }
  Become(*job, std::move(status));
}

void JobQueue::Become(Job& job, JobStatus status) {
  if (!IsActive(status.state)) status.finished_ms = NowMs();
  const std::lock_guard saving(saving_);
  Save(status);
  {
    const std::lock_guard lock(mutex_);
    job.status = std::move(status);
  }
  changed_.notify_all();
}

// A job does its work whether or not its progress can be written down at the moment.
void JobQueue::Save(const JobStatus& status) {
  if (store_ == nullptr) return;
  try {
    store_->SaveJob(ToRecord(status));
  } catch (const Error& error) {
    spdlog::warn("job {}: its state could not be saved: {}", status.id, error.what());
  }
}

std::shared_ptr<JobQueue::Job> JobQueue::Find(const std::string& id) const {
  for (const auto& job : jobs_) {
    if (job->status.id == id) return job;
  }
  throw ProblemError("job_not_found", "There is no such job, or it is long finished.");
}

JobStatus JobQueue::Get(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  return Find(id)->status;
}

JobStatus JobQueue::Cancel(const std::string& id) {
  std::shared_ptr<Job> job;
  JobStatus status;
  {
    const std::lock_guard lock(mutex_);
    job = Find(id);
    job->cancelled = true;
    job->stop.request_stop();
    status = job->status;
    if (std::erase(queue_, job) == 0) return status;  // it runs or has ended
  }
  status.state = JobState::kCancelled;
  Become(*job, std::move(status));
  return Get(id);
}

std::vector<JobStatus> JobQueue::List() const {
  const std::lock_guard lock(mutex_);
  std::vector<JobStatus> list;
  for (auto it = jobs_.rbegin(); it != jobs_.rend(); ++it) list.push_back((*it)->status);
  return list;
}

std::optional<JobStatus> JobQueue::Active(const std::string& kind,
                                          const std::string& collection) const {
  const std::lock_guard lock(mutex_);
  for (const auto& job : jobs_) {
    const JobStatus& status = job->status;
    if (status.kind == kind && status.collection == collection && IsActive(status.state)) {
      return status;
    }
  }
  return std::nullopt;
}

std::map<JobState, std::size_t> JobQueue::Counts() const {
  const std::lock_guard lock(mutex_);
  std::map<JobState, std::size_t> counts;
  for (const auto& job : jobs_) ++counts[job->status.state];
  return counts;
}

bool JobQueue::WaitFor(const std::string& id, std::chrono::milliseconds timeout) const {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, timeout, [&] {
    for (const auto& job : jobs_) {
      if (job->status.id == id) return stopping_ || !IsActive(job->status.state);
    }
    return true;  // pushed out, so finished
  });
}

}  // namespace pliant::server
