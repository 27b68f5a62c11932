// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A thread with its own connection to the primary. Every two seconds it checks the server and
// reports that this process lives. It also listens (LISTEN) for commits. Private to store/postgres.
// Thread-safe.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "index/store/postgres/pg_connection.h"

namespace pliant::postgres {

class PgMonitor {
 public:
  explicit PgMonitor(const Address* address);
  ~PgMonitor();
  PgMonitor(const PgMonitor&) = delete;
  PgMonitor& operator=(const PgMonitor&) = delete;

  const Health& health() const { return health_; }

  // Calls `wake`, which must not throw, soon after any commit, in the returned thread. It is a
  // separate thread, because applying changes can take long, and the reports must continue.
  std::jthread OnCommit(std::function<void()> wake);
  // This process's name in `processes`. The first call adds it.
  const std::string& Owner();
  // Whether the named process has reported in the last kLivesS seconds. Also true if this process
  // itself could not report for that time: while the server is away, no process can.
  bool Lives(Connection& db, const std::string& owner) const;

  static constexpr int kLivesS = 10;

 private:
  void Run(const std::stop_token& stop);
  void Beat(PgConnection& db);

  const Address& address_;
  Health health_;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable_any changed_;
  bool noticed_ = false;  // a commit for which `wake` has not been called
  std::string owner_;
  bool beaten_ = false;  // owner_ is in `processes`
  std::int64_t steady_since_ms_ =
      0;  // every report since then was in time; 0 = the last one was not
  std::jthread thread_;
};

}  // namespace pliant::postgres
