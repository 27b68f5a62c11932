// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Does the jobs of this server, one of each kind at a time, and watches the jobs of other servers.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "server/jobs/job_store.h"

namespace pliant::server {

// The connection of a running job to its server: progress and stop. Thread-safe.
struct JobContext {
  std::stop_token stop;
  std::function<void(double done, double total)> progress;
  std::function<void(const SkippedFile&)> skipped;
  std::function<void(std::uint64_t)> system_files;  // their number; see ImageFiles
};

// How jobs of one kind are done.
struct JobKind {
  // Returns the address of the result; throws Error kCancelled when it was stopped.
  std::function<std::string(const JobStatus&, const JobContext&)> run;
  // Whether a restart after an interruption gives the same result.
  bool resumes = true;
};

class JobRunner {
 public:
  static constexpr int kMaxAttempts = 3;  // limits how often a job can crash the server
  static constexpr std::chrono::milliseconds kPollEvery{1'000};

  explicit JobRunner(JobStore& store) : store_(store) {}
  // Stops running jobs and waits for their end. Another server, or the next start, continues them.
  ~JobRunner();
  JobRunner(const JobRunner&) = delete;
  JobRunner& operator=(const JobRunner&) = delete;

  // Add all kinds, then call Start(), which adopts jobs of an earlier run of the server.
  void Register(const std::string& kind, JobKind how);
  void Start();

 private:
  // Reads what other servers changed: cancels own jobs on request, wakes waits for jobs of other
  // servers, and adopts the jobs of dead servers.
  void Poll();
  void Adopt(const JobRecord& record);  // restarts the job, or ends it if it cannot be restarted
  bool MayBegin(const JobStatus& status) const;
  void Run(const std::string& kind);
  void Execute(const JobStore::OwnJobPtr& job);
  // The outcome; `problem` = what the job threw.
  void Finish(const JobStore::OwnJobPtr& job, const std::string& result,
              std::optional<Problem> problem, bool stopped);

  JobStore& store_;
  std::map<std::string, JobKind> kinds_;  // not changed after Start()
  std::vector<std::thread> threads_;
  // Of Poll():
  std::int64_t seen_version_ = -1;  // of the database
  bool others_work_ = false;        // another server has jobs that have not ended
  bool reads_ = true;               // the last poll succeeded
};

}  // namespace pliant::server
