// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs.h"

#include <algorithm>
#include <exception>
#include <random>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

namespace pliant::server {

namespace {

std::int64_t NowMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

bool IsActive(JobState state) { return state == JobState::kQueued || state == JobState::kRunning; }

}  // namespace

struct JobQueue::Job {
  JobStatus status;
  Work work;
  std::stop_source stop;
};

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

JobQueue::JobQueue() : run_id_(fmt::format("{:08x}", std::random_device{}())) {
  thread_ = std::thread([this] { Run(); });
}

JobQueue::~JobQueue() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    for (const auto& [number, job] : jobs_) job->stop.request_stop();
  }
  changed_.notify_all();
  thread_.join();
}

JobStatus JobQueue::Add(const std::string& kind, const std::string& collection, Work work) {
  const std::lock_guard lock(mutex_);
  if (queue_.size() >= kMaxQueued) {
    throw ProblemError("busy", "Too many jobs are waiting. Try again later.").RetryAfter(10);
  }
  const std::uint64_t number = next_number_++;
  auto job = std::make_shared<Job>();
  job->status.id = fmt::format("{}-{}", run_id_, number);
  job->status.kind = kind;
  job->status.collection = collection;
  job->status.created_ms = NowMs();
  job->work = std::move(work);
  jobs_.emplace(number, job);
  queue_.push_back(job);
  for (auto it = jobs_.begin(); jobs_.size() > kMaxJobs && it != jobs_.end();) {
    it = IsActive(it->second->status.state) ? std::next(it) : jobs_.erase(it);
  }
  changed_.notify_all();
  return job->status;
}

void JobQueue::Run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return stopping_ || !queue_.empty(); });
    if (stopping_) return;
    const std::shared_ptr<Job> job = queue_.front();
    queue_.pop_front();
    Execute(*job, lock);
  }
}

void JobQueue::Execute(Job& job, std::unique_lock<std::mutex>& lock) {
  job.status.state = JobState::kRunning;
  const JobContext context(job.stop.get_token(), [&](double done, double total) {
    const std::lock_guard report_lock(mutex_);
    job.status.done = done;
    job.status.total = total;
  });
  std::string result;
  std::optional<Problem> problem;
  bool cancelled = false;
  lock.unlock();
  try {
    result = job.work(context);
  } catch (const Error& error) {
    cancelled = error.code() == ErrorCode::kCancelled;
    problem = CurrentProblem();
  } catch (...) {
    problem = CurrentProblem();
  }
  lock.lock();
  job.work = nullptr;
  if (!problem) {
    job.status.result = result;
    job.status.done = job.status.total;
    Finish(job, JobState::kDone);
  } else if (cancelled) {
    Finish(job, JobState::kCancelled);
  } else {
    spdlog::error("job {} ({}) failed: {} {} {}", job.status.id, job.status.kind, problem->code,
                  problem->detail, problem->internal);
    job.status.problem = std::move(problem);
    Finish(job, JobState::kFailed);
  }
}

void JobQueue::Finish(Job& job, JobState state) {
  job.status.state = state;
  job.status.finished_ms = NowMs();
  changed_.notify_all();
}

JobQueue::Job& JobQueue::Find(const std::string& id) const {
  for (const auto& [number, job] : jobs_) {
    if (job->status.id == id) return *job;
  }
  throw ProblemError("job_not_found", "There is no such job, or it is long finished.");
}

JobStatus JobQueue::Get(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  return Find(id).status;
}

JobStatus JobQueue::Cancel(const std::string& id) {
  const std::lock_guard lock(mutex_);
  Job& job = Find(id);
  job.stop.request_stop();
  if (job.status.state == JobState::kQueued) {
    std::erase_if(queue_, [&](const auto& queued) { return queued.get() == &job; });
    Finish(job, JobState::kCancelled);
  }
  return job.status;
}

std::vector<JobStatus> JobQueue::List() const {
  const std::lock_guard lock(mutex_);
  std::vector<JobStatus> list;
  for (auto it = jobs_.rbegin(); it != jobs_.rend(); ++it) list.push_back(it->second->status);
  return list;
}

std::optional<JobStatus> JobQueue::Active(const std::string& kind,
                                          const std::string& collection) const {
  const std::lock_guard lock(mutex_);
  for (const auto& [number, job] : jobs_) {
    const JobStatus& status = job->status;
    if (status.kind == kind && status.collection == collection && IsActive(status.state)) {
      return status;
    }
  }
  return std::nullopt;
}

bool JobQueue::WaitFor(const std::string& id, std::chrono::milliseconds timeout) const {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, timeout, [&] {
    for (const auto& [number, job] : jobs_) {
      if (job->status.id == id) return stopping_ || !IsActive(job->status.state);
    }
    return true;  // pushed out, so finished
  });
}

}  // namespace pliant::server
