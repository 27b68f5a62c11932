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
    } catch (const Error& error) {
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
    cancelled = Look();
  }
  for (const std::string& id : cancelled) Cancel(id);
}

std::vector<std::string> JobQueue::Look() {
  const std::int64_t version = store_->Version();
  if (version == seen_version_ && !others_work_) return {};
  const std::vector<JobRecord> records = store_->Jobs();
  std::vector<std::string> cancelled;
  others_work_ = false;
  for (const JobRecord& record : records) {
    const auto job = See(record);
    if (job == nullptr) {
      if (record.cancel) cancelled.push_back(record.id);
    } else if (IsActive(job->status.state)) {
      // An own one that is not known is of a queue before this one in the same process.
      if (record.owner == owner_ || !store_->Lives(record.owner)) {
        TakeUp(job);
        if (record.cancel) cancelled.push_back(record.id);
      } else {
        others_work_ = true;
      }
    }
  }
  ForgetVanished(records);
  changed_.notify_all();
  seen_version_ = version;  // not before all was seen
  return cancelled;
}

std::shared_ptr<JobQueue::Job> JobQueue::See(const JobRecord& record) {
  JobStatus status = FromRecord(record);
  const std::lock_guard lock(mutex_);
  std::shared_ptr<Job> job = FindOrNull(record.id);
  if (job == nullptr) {
    job = std::make_shared<Job>();
    jobs_.push_back(job);
  } else if (job->owner == owner_ && record.owner == owner_) {
    return nullptr;
  } else if (job->owner == owner_) {
    std::erase(queue_, job);  // it was taken away
    job->stop.request_stop();
  }
  job->owner = record.owner;
  job->status = std::move(status);
  return job;
}

void JobQueue::ForgetVanished(const std::vector<JobRecord>& records) {
  std::set<std::string> ids;
  for (const JobRecord& record : records) ids.insert(record.id);
  const std::lock_guard lock(mutex_);
  std::erase_if(jobs_, [&](const auto& job) {
    return !IsActive(job->status.state) && job->owner != owner_ && !ids.contains(job->status.id);
  });
}

void JobQueue::TakeUp(const std::shared_ptr<Job>& job) {
  if (job->owner != owner_ && !store_->TakeJob(job->status.id, job->owner)) {
    others_work_ = true;  // another server was faster
    return;
  }
  JobStatus status;
  {
    const std::lock_guard lock(mutex_);
    job->owner = owner_;
    job->stop = std::stop_source();
    job->cancelled = false;
    status = job->status;
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
