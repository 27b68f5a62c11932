// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Work that outlives a request, and the server: every job is kept in the database, and one whose
// server ended is begun again where its kind allows that, or marked as failed.
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
#include <span>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "index/json/json.h"
#include "index/store/service_store.h"
#include "server/http/problem.h"
#include "server/jobs/job_waiters.h"

namespace pliant::server {

enum class JobState { kQueued, kRunning, kDone, kFailed, kCancelled };

std::string JobStateName(JobState state);
bool IsActive(JobState state);  // it has not ended

// One item that a job left out, and why.
struct SkippedItem {
  std::string item;
  std::string code;
  std::string reason;
};

struct JobStatus {
  std::string id;
  std::string kind;  // "train", "activate", "import", "backup"
  std::string collection;
  Json parameters = Json::object();
  JobState state = JobState::kQueued;
  double done = 0;  // of `total`
  double total = 1;
  std::uint64_t failed = 0;          // items that could not be done
  int attempts = 0;                  // times it was begun
  std::vector<SkippedItem> skipped;  // the first JobQueue::kMaxSkipped of them
  std::optional<Problem> problem;    // when kFailed
  std::string result;                // address of what was made; empty until kDone
  std::int64_t created_ms = 0;
  std::int64_t finished_ms = 0;  // 0 = not yet
};

[[noreturn]] void ThrowJobNotFound();  // ProblemError "job_not_found"

// What a running job may do with itself. Thread-safe.
class JobContext {
 public:
  using Report = std::function<void(double done, double total)>;
  using Skip = std::function<void(const SkippedItem&)>;

  JobContext(std::stop_token stop, Report report, Skip skip)
      : stop_(std::move(stop)), report_(std::move(report)), skip_(std::move(skip)) {}

  const std::stop_token& stop() const { return stop_; }
  void Progress(double done, double total) const { report_(done, total); }
  void Skipped(const SkippedItem& item) const { skip_(item); }

 private:
  std::stop_token stop_;
  Report report_;
  Skip skip_;
};

// How jobs of one kind are done.
struct JobKind {
  // Returns the address of the result; throws Error kCancelled when it was stopped.
  std::function<std::string(const JobStatus&, const JobContext&)> run;
  // Whether beginning again after an interruption leads to the same end.
  bool resumes = true;
  // Called when a job of this server's has ended, however that came; quick, throws nothing.
  std::function<void(const JobStatus&)> ended = {};
};

// Runs one job of each kind at a time. Thread-safe. Jobs that have ended are remembered until
// kMaxJobs newer ones push them out. Several servers may share a database: each does its own jobs,
// shows those of the others, and takes over what a server that no longer lives has left.
class JobQueue {
 public:
  static constexpr std::size_t kMaxJobs = 1000;
  static constexpr std::size_t kMaxQueued = 16;
  static constexpr std::size_t kMaxSkipped = 100;
  static constexpr int kMaxAttempts = 3;  // a job that ends the server must not do so for ever
  static constexpr std::chrono::milliseconds kSaveEvery{1'000};  // of the progress
  static constexpr std::chrono::milliseconds kLookEvery{1'000};  // for what other servers do

  // `store` may be null: then nothing is kept. It must outlive the queue.
  explicit JobQueue(ServiceStore* store);
  ~JobQueue();  // stops what runs and waits for it; another server or the next start takes it up
  JobQueue(const JobQueue&) = delete;
  JobQueue& operator=(const JobQueue&) = delete;

  // All kinds, then Start(): it takes up what an earlier run of the server left.
  void Register(const std::string& kind, JobKind how);
  void Start();

  // Throws ProblemError "busy" when too many jobs wait, and what the store throws.
  JobStatus Add(const std::string& kind, const std::string& collection, const Json& parameters);

  // The same unless a job of that kind in that collection has not ended, here or at another server:
  // then nothing.
  std::optional<JobStatus> AddOnly(const std::string& kind, const std::string& collection,
                                   const Json& parameters);

  // The same, with what the job works on, which its kind finds again in store().
  JobStatus AddWithInput(const std::string& kind, const std::string& collection,
                         const Json& parameters, std::span<const std::uint8_t> input);

  // What is kept of jobs beside their state. Throws std::logic_error where nothing is kept.
  ServiceStore& store() const;

  // Throw ProblemError "job_not_found".
  JobStatus Get(const std::string& id) const;
  // No effect on a job that has ended. One that runs, here or at another server, ends soon and is
  // not begun again by anyone. Throws what the store throws when that cannot be written down.
  JobStatus Cancel(const std::string& id);

  // Sees at once what other servers have made, unless something is being written; else that happens
  // every kLookEvery. Throws what the store throws.
  void LookNow();

  std::vector<JobStatus> List() const;  // newest first
  // A queued or running job of that kind, if any.
  std::optional<JobStatus> Active(const std::string& kind, const std::string& collection) const;
  std::map<JobState, std::size_t> Counts() const;

  // True when the job ended within the time.
  bool WaitFor(const std::string& id, std::chrono::milliseconds timeout) const;

  // Calls `wake` when WaitFor() would return, at once if that is so already; see JobWaiters::Add().
  std::shared_ptr<void> WhenEnded(const std::string& id, JobWaiters::Wake wake) const;

 private:
  struct Job {
    JobStatus status;
    std::string owner;     // owner_: it is done here
    bool begun = false;    // by this queue
    bool unsaved = false;  // its row is not what it has become; guarded by saving_
    std::stop_source stop;
    bool cancelled = false;
    std::chrono::steady_clock::time_point saved;
  };

  // Add(), AddOnly() and AddWithInput(), which `save` writes down; nothing = there is one, and
  // `only`, or `save` gave false.
  std::optional<JobStatus> AddNew(const std::string& kind, const std::string& collection,
                                  const Json& parameters, bool only,
                                  const std::function<bool(const JobRecord& job)>& save);
  // A queued or running job of that kind; mutex_ held.
  std::optional<JobStatus> ActiveLocked(const std::string& kind,
                                        const std::string& collection) const;
  // Sees what other servers have written, and takes up what nobody does; saving_ held. Returns own
  // jobs whose end another server asked for.
  std::vector<std::string> Look();
  void Watch();  // looks every kLookEvery
  void CancelOwn(const std::string& id);
  // One row as a job in jobs_; null = an own one, which is known better here.
  std::shared_ptr<Job> See(const JobRecord& record);
  void ForgetVanished(const std::vector<JobRecord>& records);
  void TakeUp(const std::shared_ptr<Job>& job, bool cancelled);  // saving_ held
  void SaveAgain();  // what could not be written; saving_ held
  bool MayGoOn(const JobStatus& status) const;
  void Run(const std::string& kind);
  std::shared_ptr<Job> TakeNext(const std::string& kind);  // mutex_ held; null = none waits
  bool IsOwn(const Job& job) const;
  // One that the database did not let go on is begun again.
  void Execute(const std::shared_ptr<Job>& job);
  void AwaitStore(const std::stop_token& stop);  // until it answers, or the job is to end
  void OnProgress(Job& job, double done, double total);
  std::shared_ptr<Job> FindOrNull(const std::string& id) const;  // mutex_ held
  bool HasEnded(const std::string& id) const;                    // mutex_ held
  void NotifyAll() const;  // something that somebody may wait for has changed; no mutex held
  void Forget();           // mutex_ held; what is too old
  void ForgetRows();       // saving_ held; the same in the store
  // Writes down what a job has become, then shows it. No mutex held.
  void Become(Job& job, JobStatus status);
  void BecomeNow(Job& job, JobStatus status);    // the same with saving_ held
  void Save(Job& job, const JobStatus& status);  // saving_ held; a failure is logged

  ServiceStore* store_;
  const std::string owner_;               // this process's name; empty without a store
  std::int64_t seen_version_ = -1;        // of the store, by Look(); guarded by saving_
  bool others_work_ = false;              // jobs of others that have not ended; guarded by saving_
  std::map<std::string, JobKind> kinds_;  // not changed after Start()
  // Held while a row is written, which may take as long as another process holds the database:
  // rows are written one after the other, each as its job was when its turn came. Taken before
  // mutex_, and never with it held.
  std::mutex saving_;
  mutable std::mutex mutex_;  // guards all below; never held while something is written
  mutable std::condition_variable changed_;
  const std::shared_ptr<JobWaiters> waiters_ = std::make_shared<JobWaiters>();
  std::vector<std::shared_ptr<Job>> jobs_;  // oldest first
  std::deque<std::shared_ptr<Job>> queue_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace pliant::server
