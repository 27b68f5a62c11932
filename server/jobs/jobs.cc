// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/jobs.h"

#include <algorithm>
#include <random>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "server/jobs/job_record.h"

namespace pliant::server {

namespace {

std::string NewId() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}", random(), random());
}

}  // namespace

bool IsActive(JobState state) { return state == JobState::kQueued || state == JobState::kRunning; }

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
    job->cancelled = job->status.cancelled;
    if (job->cancelled || !MayGoOn(job->status)) {
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
    JobStatus ended = job->status;
    ended.state = ended.cancelled ? JobState::kCancelled : JobState::kFailed;
    if (!ended.cancelled) {
      ended.problem =
          ProblemError("interrupted",
                       "The server ended while this ran, and it cannot go on. Start it anew.")
              .problem();
    }
    Become(*job, std::move(ended));
  }
}

JobStatus JobQueue::Add(const std::string& kind, const std::string& collection,
                        const Json& parameters) {
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
  job->status.created_ms = UnixMs();
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
  bool waited = false;
  {
    const std::lock_guard lock(mutex_);
    job = Find(id);
    status = job->status;
    if (!IsActive(status.state)) return status;
    job->cancelled = true;
    job->stop.request_stop();
    waited = std::erase(queue_, job) > 0;
  }
  if (waited) {
    status.state = JobState::kCancelled;
    Become(*job, std::move(status));
    return Get(id);
  }
  const std::lock_guard saving(saving_);
  {
    const std::lock_guard lock(mutex_);
    status = job->status;
  }
  if (IsActive(status.state)) SaveOrThrow(*job, status);  // what is promised must survive
  return status;
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
