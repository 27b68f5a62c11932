// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Work that outlives a request: one after the other on a thread of its own.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "server/problem.h"

namespace pliant::server {

enum class JobState { kQueued, kRunning, kDone, kFailed, kCancelled };

std::string JobStateName(JobState state);

struct JobStatus {
  std::string id;
  std::string kind;  // "train"
  std::string collection;
  JobState state = JobState::kQueued;
  double done = 0;  // of `total`
  double total = 1;
  std::uint64_t failed = 0;        // items that could not be done
  std::optional<Problem> problem;  // when kFailed
  std::string result;              // address of what was made; empty until kDone
  std::int64_t created_ms = 0;
  std::int64_t finished_ms = 0;  // 0 = not yet
};

// What a running job may do with itself.
class JobContext {
 public:
  JobContext(std::stop_token stop, std::function<void(double, double)> report)
      : stop_(std::move(stop)), report_(std::move(report)) {}

  const std::stop_token& stop() const { return stop_; }
  void Report(double done, double total) const { report_(done, total); }

 private:
  std::stop_token stop_;
  std::function<void(double, double)> report_;
};

// Thread-safe. Finished jobs are remembered until kMaxJobs newer ones push them out.
class JobQueue {
 public:
  static constexpr std::size_t kMaxJobs = 1000;
  static constexpr std::size_t kMaxQueued = 16;

  // Returns the address of the result.
  using Work = std::function<std::string(const JobContext&)>;

  JobQueue();
  ~JobQueue();  // cancels what runs and waits for it
  JobQueue(const JobQueue&) = delete;
  JobQueue& operator=(const JobQueue&) = delete;

  // Throws ProblemError "busy" when too many jobs wait.
  JobStatus Add(const std::string& kind, const std::string& collection, Work work);

  // Throw ProblemError "job_not_found".
  JobStatus Get(const std::string& id) const;
  JobStatus Cancel(const std::string& id);  // no effect on a finished job

  std::vector<JobStatus> List() const;  // newest first
  // A queued or running job of that kind, if any.
  std::optional<JobStatus> Active(const std::string& kind, const std::string& collection) const;

  // True when the job ended within the time.
  bool WaitFor(const std::string& id, std::chrono::milliseconds timeout) const;

 private:
  struct Job;

  void Run();
  void Execute(Job& job, std::unique_lock<std::mutex>& lock);
  Job& Find(const std::string& id) const;  // mutex_ held
  void Finish(Job& job, JobState state);   // mutex_ held

  mutable std::mutex mutex_;  // guards all below
  mutable std::condition_variable changed_;
  std::map<std::uint64_t, std::shared_ptr<Job>> jobs_;  // by number, oldest first
  std::deque<std::shared_ptr<Job>> queue_;
  std::uint64_t next_number_ = 1;
  std::string run_id_;  // ids of an earlier run of the server are never reused
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace pliant::server
