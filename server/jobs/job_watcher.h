// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Watches the jobs in the database for changes by other servers.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <thread>

#include "server/jobs/job_store.h"

namespace pliant::server {

// Cancels own jobs on request of another server, wakes waits for other servers' jobs, and offers
// the jobs of dead servers to `adopt`.
class JobWatcher {
 public:
  using Adopt = std::function<void(const JobRecord&)>;
  static constexpr std::chrono::milliseconds kPollEvery{1'000};

  // Polls once at once.
  JobWatcher(JobStore& store, Adopt adopt);
  ~JobWatcher();  // after JobStore::Stop()
  JobWatcher(const JobWatcher&) = delete;
  JobWatcher& operator=(const JobWatcher&) = delete;

 private:
  void Poll();

  JobStore& store_;
  const Adopt adopt_;
  std::int64_t seen_version_ = -1;  // of the database
  bool others_work_ = false;        // another server has jobs that have not ended
  bool works_ = true;               // the last poll succeeded
  std::thread thread_;
};

}  // namespace pliant::server
