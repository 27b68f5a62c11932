// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/jobs.h"

#include <algorithm>
#include <stdexcept>

#include <spdlog/spdlog.h>

#include "descriptor/base/hex.h"
#include "descriptor/base/unix_time.h"
#include "server/jobs/job_record.h"

namespace pliant::server {

namespace {

constexpr std::size_t kIdDigits = 16;

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

JobQueue::JobQueue(ServiceStore* store)
    : store_(store), owner_(store == nullptr ? "" : store->Owner()) {}

JobQueue::~JobQueue() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    for (const auto& job : jobs_) job->stop.request_stop();
  }
  NotifyAll();
  for (std::thread& thread : threads_) thread.join();
}

void JobQueue::Register(const std::string& kind, JobKind how) {
  kinds_.emplace(kind, std::move(how));
}

void JobQueue::Start() {
  try {
    LookNow();
  } catch (const std::exception& error) {  // a full or busy disk: Watch() tries again
    spdlog::warn("what the server was doing cannot be taken up yet: {}", error.what());
  }
  const std::lock_guard lock(mutex_);
  for (const auto& [kind, how] : kinds_) {
    threads_.emplace_back([this, name = kind] { Run(name); });
  }
  if (store_ != nullptr) threads_.emplace_back([this] { Watch(); });
}

JobStatus JobQueue::Add(const std::string& kind, const std::string& collection,
                        const Json& parameters) {
  return *AddNew(kind, collection, parameters, /*only=*/false, [this](const JobRecord& job) {
    return store_ == nullptr || store_->SaveJob(job);
  });
}

std::optional<JobStatus> JobQueue::AddOnly(const std::string& kind, const std::string& collection,
                                           const Json& parameters) {
  return AddNew(kind, collection, parameters, /*only=*/true, [this](const JobRecord& job) {
    return store_ == nullptr || store_->AddOnlyJob(job);
  });
}

JobStatus JobQueue::AddWithInput(const std::string& kind, const std::string& collection,
                                 const Json& parameters, std::span<const std::uint8_t> input) {
  return *AddNew(kind, collection, parameters, /*only=*/false, [&](const JobRecord& job) {
    store().AddJob(job, input);
    return true;
  });
}

ServiceStore& JobQueue::store() const {
  if (store_ == nullptr) throw std::logic_error("these jobs are kept nowhere");
  return *store_;
}

std::optional<JobStatus> JobQueue::AddNew(const std::string& kind, const std::string& collection,
                                          const Json& parameters, bool only,
                                          const std::function<bool(const JobRecord& job)>& save) {
  const std::lock_guard saving(saving_);
  {
    const std::lock_guard lock(mutex_);
    if (only && ActiveLocked(kind, collection)) return std::nullopt;
    if (queue_.size() >= kMaxQueued) {
      throw ProblemError("busy", "Too many jobs are waiting. Try again later.").RetryAfter(10);
    }
  }
  auto job = std::make_shared<Job>();
  job->status.id = RandomHex(kIdDigits);
  job->status.kind = kind;
  job->status.collection = collection;
  job->status.parameters = parameters;
  job->status.created_ms = NowMs();
  job->owner = owner_;
  const JobStatus added = job->status;
  if (!save(ToRecord(added, owner_))) return std::nullopt;  // what is promised must survive
  bool full = false;
  {
    const std::lock_guard lock(mutex_);
    jobs_.push_back(job);
    queue_.push_back(job);
    full = jobs_.size() > kMaxJobs;
    if (full) Forget();
  }
  NotifyAll();
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

std::shared_ptr<JobQueue::Job> JobQueue::FindOrNull(const std::string& id) const {
  const auto found = std::find_if(jobs_.begin(), jobs_.end(),
                                  [&](const auto& job) { return job->status.id == id; });
  return found == jobs_.end() ? nullptr : *found;
}

void ThrowJobNotFound() {
  throw ProblemError("job_not_found", "There is no such job, or it is long finished.");
}

JobStatus JobQueue::Get(const std::string& id) const {
  {
    const std::lock_guard lock(mutex_);
    if (const auto job = FindOrNull(id)) return job->status;
  }
  if (store_ != nullptr) {  // another server may have just made it
    for (const JobRecord& record : store_->Jobs()) {
      if (record.id == id) return FromRecord(record);
    }
  }
  ThrowJobNotFound();
}

JobStatus JobQueue::Cancel(const std::string& id) {
  const JobStatus status = Get(id);
  if (!IsActive(status.state)) return status;
  if (store_ != nullptr) store_->RequestCancel(id);  // what is promised must survive
  CancelOwn(id);
  return Get(id);
}

void JobQueue::CancelOwn(const std::string& id) {
  std::shared_ptr<Job> job;
  JobStatus status;
  {
    const std::lock_guard lock(mutex_);
    job = FindOrNull(id);
    if (job == nullptr || job->owner != owner_ || !IsActive(job->status.state)) return;
    job->cancelled = true;
    job->stop.request_stop();
    if (std::erase(queue_, job) == 0) return;  // it runs
    status = job->status;
  }
  status.state = JobState::kCancelled;
  Become(*job, std::move(status));
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
  return ActiveLocked(kind, collection);
}

std::optional<JobStatus> JobQueue::ActiveLocked(const std::string& kind,
                                                const std::string& collection) const {
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
  return changed_.wait_for(lock, timeout, [&] { return HasEnded(id); });
}

std::shared_ptr<void> JobQueue::WhenEnded(const std::string& id, JobWaiters::Wake wake) const {
  auto subscription = waiters_->Add(id, std::move(wake));
  const std::lock_guard lock(mutex_);
  if (HasEnded(id)) {
    waiters_->WakeWhere([&id](const std::string& waited_for) { return waited_for == id; });
  }
  return subscription;
}

bool JobQueue::HasEnded(const std::string& id) const {
  const auto job = FindOrNull(id);
  return job == nullptr ||  // pushed out, so finished
         stopping_ || !IsActive(job->status.state);
}

void JobQueue::NotifyAll() const {
  changed_.notify_all();
  const std::lock_guard lock(mutex_);
  waiters_->WakeWhere([this](const std::string& id) { return HasEnded(id); });
}

}  // namespace pliant::server
