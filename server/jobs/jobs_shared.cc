// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// JobQueue: what several servers on one database see of each other's jobs.
#include <algorithm>
#include <set>

#include <spdlog/spdlog.h>

#include "descriptor/base/error.h"
#include "server/jobs/job_record.h"
#include "server/jobs/jobs.h"

namespace pliant::server {

void JobQueue::Watch() {
  bool works = true;
  while (true) {
    {
      std::unique_lock lock(mutex_);
      if (changed_.wait_for(lock, kLookEvery, [&] { return stopping_; })) return;
    }
    try {
      LookNow();
      works = true;
    } catch (const std::exception& error) {
      if (std::exchange(works, false)) {
        spdlog::warn("the jobs of other servers cannot be seen: {}", error.what());
      }
    }
  }
}

void JobQueue::LookNow() {
  if (store_ == nullptr) return;
  std::vector<std::string> cancelled;
  {
    const std::unique_lock saving(saving_, std::try_to_lock);
    if (!saving) return;
    SaveAgain();
    cancelled = Look();
  }
  for (const std::string& id : cancelled) CancelOwn(id);
}

void JobQueue::SaveAgain() {
  std::vector<std::pair<std::shared_ptr<Job>, JobStatus>> unsaved;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& job : jobs_) {
      if (job->unsaved && job->owner == owner_) unsaved.emplace_back(job, job->status);
    }
  }
  for (const auto& [job, status] : unsaved) Save(*job, status);
}

std::vector<std::string> JobQueue::Look() {
  const std::int64_t version = store_->Version();
  if (version == seen_version_ && !others_work_) return {};
  seen_version_ = -1;  // not before all was seen
  others_work_ = false;
  const std::vector<JobRecord> records = store_->Jobs();
  std::vector<std::string> cancelled;
  for (const JobRecord& record : records) {
    const auto job = See(record);
    if (job == nullptr) {
      if (record.cancel) cancelled.push_back(record.id);
    } else if (IsActive(job->status.state)) {
      // An own one that is not known is of a queue before this one in the same process.
      if (record.owner == owner_ || !store_->Lives(record.owner)) {
        TakeUp(job, record.cancel);
      } else {
        others_work_ = true;
      }
    }
  }
  ForgetVanished(records);
  NotifyAll();
  seen_version_ = version;
  return cancelled;
}

std::shared_ptr<JobQueue::Job> JobQueue::See(const JobRecord& record) {
  JobStatus status = FromRecord(record);
  const std::lock_guard lock(mutex_);
  const auto known = std::find_if(jobs_.begin(), jobs_.end(),
                                  [&](const auto& job) { return job->status.id == record.id; });
  if (known == jobs_.end()) {
    jobs_.push_back(std::make_shared<Job>());
    jobs_.back()->owner = record.owner;
    jobs_.back()->status = std::move(status);
    return jobs_.back();
  }
  if ((*known)->owner == owner_ && record.owner == owner_) return nullptr;
  std::erase(queue_, *known);  // an own one was taken away
  if ((*known)->begun) {       // and still runs: whatever comes of it, it is not that job any more
    (*known)->owner.clear();
    (*known)->stop.request_stop();
    *known = std::make_shared<Job>();
  }
  (*known)->owner = record.owner;
  (*known)->status = std::move(status);
  return *known;
}

void JobQueue::ForgetVanished(const std::vector<JobRecord>& records) {
  std::set<std::string> ids;
  for (const JobRecord& record : records) ids.insert(record.id);
  const std::lock_guard lock(mutex_);
  std::erase_if(jobs_, [&](const auto& job) {
    return !IsActive(job->status.state) && !job->unsaved && !ids.contains(job->status.id);
  });
}

void JobQueue::TakeUp(const std::shared_ptr<Job>& job, bool cancelled) {
  if (job->owner != owner_ && !store_->TakeJob(job->status.id, job->owner)) {
    others_work_ = true;  // another server was faster
    return;
  }
  JobStatus status;
  {
    const std::lock_guard lock(mutex_);
    job->owner = owner_;
    status = job->status;
  }
  if (cancelled) {
    status.state = JobState::kCancelled;
    return BecomeNow(*job, std::move(status));
  }
  if (!MayGoOn(status)) {
    status.state = JobState::kFailed;
    status.problem = ProblemError("interrupted",
                                  "The server ended while this ran, and it cannot go on. Start it "
                                  "anew.")
                         .problem();
    return BecomeNow(*job, std::move(status));
  }
  if (status.state == JobState::kRunning) {
    spdlog::info("job {} ({}) goes on", status.id, status.kind);
  }
  const std::lock_guard lock(mutex_);
  job->status.state = JobState::kQueued;
  queue_.push_back(job);
}

bool JobQueue::MayGoOn(const JobStatus& status) const {
  const auto kind = kinds_.find(status.kind);
  if (kind == kinds_.end()) return false;
  return status.state == JobState::kQueued ||
         (kind->second.resumes && status.attempts < kMaxAttempts);
}

}  // namespace pliant::server
