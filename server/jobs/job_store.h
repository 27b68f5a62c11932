// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Jobs: work that outlives a request, and the server. Each job is a row of the database, which
// several servers may share.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "index/files/image_files.h"
#include "index/json/json.h"
#include "index/store/service_store.h"
#include "server/http/problem.h"

namespace pliant::server {

enum class JobState { kQueued, kRunning, kDone, kFailed, kCancelled };

std::string JobStateName(JobState state);
bool IsActive(JobState state);  // it has not ended

struct JobStatus : JobFields {
  Json parameters = Json::object();
  JobState state = JobState::kQueued;
  std::vector<SkippedFile> skipped = {};  // items; the first JobStore::kMaxSkipped of them
  std::uint64_t system_files = 0;         // of an import: left out; see ImageFiles
  std::optional<Problem> problem = {};    // when kFailed
};

JobRecord ToRecord(const JobStatus& status, const std::string& owner);
// Leaves out JSON that does not have the expected form.
JobStatus FromRecord(const JobRecord& record);

[[noreturn]] void ThrowJobNotFound();  // ProblemError "job_not_found"

// Waits for the end of jobs, without threads. Thread-safe.
class JobWaiters : public std::enable_shared_from_this<JobWaiters> {
 public:
  using Wake = std::function<void()>;

  // Calls `wake` at most once, and not after the returned object is gone, which may outlive all
  // other users of this. `wake` must not wait, nor call this.
  std::shared_ptr<void> Add(const std::string& id, Wake wake);
  std::set<std::string> Ids() const;  // of the jobs with waiters
  void WakeAll(const std::string& id);

 private:
  mutable std::mutex mutex_;                                   // guards waiters_
  std::multimap<std::string, std::shared_ptr<Wake>> waiters_;  // by job
};

// The jobs of all servers are read from the database; those of this server that have not ended are
// also in memory, where they are newer. Thread-safe. All methods throw what the database throws.
class JobStore {
 public:
  static constexpr std::size_t kMaxJobs = 1000;  // older ones that have ended are forgotten
  static constexpr std::size_t kMaxQueued = 16;
  static constexpr std::size_t kMaxSkipped = 100;
  static constexpr std::chrono::milliseconds kSaveEvery{1'000};  // of the progress

  using OnEnded = std::function<void(const JobStatus&)>;
  // `on_ended` is called for each job of this server that has ended; quick, throws nothing.
  explicit JobStore(ServiceStore& rows, OnEnded on_ended = {});
  JobStore(const JobStore&) = delete;
  JobStore& operator=(const JobStore&) = delete;

  // Throws ProblemError "busy" when too many jobs of this server wait. The database keeps `input`,
  // the data of the job, until the job ends.
  JobStatus Add(const std::string& kind, const std::string& collection, const Json& parameters,
                const std::optional<std::span<const std::uint8_t>>& input = {});
  // Nothing if a job of that kind in that collection has not ended, here or at another server.
  std::optional<JobStatus> AddOnly(const std::string& kind, const std::string& collection,
                                   const Json& parameters);

  JobStatus Get(const std::string& id) const;  // throws ProblemError "job_not_found"
  std::vector<JobStatus> List() const;         // newest first
  // A queued or running job of that kind, if any.
  std::optional<JobStatus> Active(const std::string& kind, const std::string& collection) const;
  std::map<JobState, std::size_t> Counts() const;

  // No effect on a job that has ended. A running job, here or at another server, ends soon, and no
  // server begins it again. Throws ProblemError "job_not_found".
  JobStatus Cancel(const std::string& id);

  // Calls `wake` when the job has ended or Stop() was called; see JobWaiters::Add(). Asks no
  // database: the end of another server's job, or an earlier end, is noticed by JobRunner.
  std::shared_ptr<void> WhenEnded(const std::string& id, JobWaiters::Wake wake) const;
  // True when that happened within the time. Throws ProblemError "job_not_found".
  bool WaitFor(const std::string& id, std::chrono::milliseconds timeout) const;

  ServiceStore& rows() const { return rows_; }

  // For JobRunner.

  // A job of this server that has not ended, or whose end could not be written.
  struct OwnJob {
    JobStatus status;        // guarded, as all but `stop`, by JobStore
    bool waits = false;      // for a thread of its kind
    bool cancelled = false;  // on request
    std::stop_source stop = {};
    std::chrono::steady_clock::time_point saved = {};
  };
  using OwnJobPtr = std::shared_ptr<OwnJob>;

  // Waits for a job of the kind, and begins it. Null after Stop().
  OwnJobPtr Take(const std::string& kind);
  // Makes a job of the server `from`, or of an earlier store of this process, an own one: it waits
  // if its state is kQueued. False: it is an own one already, has ended, or another server has it.
  bool Adopt(const std::string& from, const JobStatus& status);
  bool IsOwn(const OwnJobPtr& job) const;  // false once another server has adopted it
  OwnJob Snapshot(const OwnJobPtr& job) const;
  void Progress(const OwnJobPtr& job, double done, double total);
  void Skip(const OwnJobPtr& job, const SkippedFile& item);
  void SetSystemFiles(const OwnJobPtr& job, std::uint64_t files);
  // Writes the state; a failure is logged. False: it could not be written.
  bool Save(const OwnJobPtr& job, const JobStatus& status);
  // Writes the state, then shows it, also if it could not be written; JobRunner writes it later.
  void Update(const OwnJobPtr& job, JobStatus status);
  void SaveEnds();                        // the ends that could not be written
  void CancelOwn(const std::string& id);  // no effect on jobs of other servers
  JobWaiters& waiters() const { return *waiters_; }
  void Stop();  // asks all jobs to end
  bool StoppedWithin(std::chrono::milliseconds time) const;

 private:
  std::optional<JobStatus> AddNew(const std::string& kind, const std::string& collection,
                                  const Json& parameters,
                                  const std::function<bool(const JobRecord& job)>& save);
  OwnJobPtr FindOwn(const std::string& id) const;  // mutex_ held; null = not an own one

  ServiceStore& rows_;
  const OnEnded on_ended_;
  const std::shared_ptr<JobWaiters> waiters_ = std::make_shared<JobWaiters>();
  mutable std::mutex mutex_;  // guards all below; never held while the database is asked
  mutable std::condition_variable changed_;
  std::vector<OwnJobPtr> own_;  // oldest first
  bool stopping_ = false;
};

}  // namespace pliant::server
