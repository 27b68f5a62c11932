// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Does the jobs of this server, one of each kind at a time.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "server/jobs/job_store.h"
#include "server/jobs/job_watcher.h"

namespace pliant::server {

// What a running job tells, and is told. Thread-safe.
struct JobContext {
  std::stop_token stop;
  std::function<void(double done, double total)> progress;
  std::function<void(const SkippedItem&)> skipped;
};

// How jobs of one kind are done.
struct JobKind {
  // Returns the address of the result; throws Error kCancelled when it was stopped.
  std::function<std::string(const JobStatus&, const JobContext&)> run;
  // Whether beginning again after an interruption leads to the same end.
  bool resumes = true;
};

class JobRunner {
 public:
  static constexpr int kMaxAttempts = 3;  // a job that ends the server must not do so for ever

  explicit JobRunner(JobStore& store) : store_(store) {}
  // Stops what runs and waits for its end. Another server, or the next start, goes on with it.
  ~JobRunner();
  JobRunner(const JobRunner&) = delete;
  JobRunner& operator=(const JobRunner&) = delete;

  // All kinds, then Start(), which adopts what an earlier run of the server left.
  void Register(const std::string& kind, JobKind how);
  void Start();

 private:
  void Adopt(const JobRecord& record);  // begins again, or ends what cannot begin again
  bool MayBegin(const JobStatus& status) const;
  void Run(const std::string& kind);
  void Execute(const JobStore::OwnJobPtr& job);
  // The outcome; `problem` = what the job threw.
  void Finish(const JobStore::OwnJobPtr& job, const std::string& result,
              std::optional<Problem> problem, bool stopped);

  JobStore& store_;
  std::map<std::string, JobKind> kinds_;  // not changed after Start()
  std::unique_ptr<JobWatcher> watcher_;
  std::vector<std::thread> threads_;
};

}  // namespace pliant::server
