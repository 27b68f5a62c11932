// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A thread with a connection of its own to the primary, on which it asks every two seconds whether
// the server is there, says that this process lives, and hears (LISTEN) of commits. Private to
// store/postgres. Thread-safe.
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

  // Calls `wake`, which must not throw, soon after any commit, in the thread that is returned:
  // apart, as following others may take long, and this process lives meanwhile.
  std::jthread OnCommit(std::function<void()> wake);
  // This process's name in `processes`, where it is from the first call on.
  const std::string& Owner();
  // Whether the process of a name has said in the last kLivesS seconds that it lives. True, too,
  // where this process has not been heard itself for so long: while the server was away nobody
  // could say so.
  bool Lives(Connection& db, const std::string& owner) const;

  static constexpr int kLivesS = 10;

 private:
  void Run(const std::stop_token& stop);
  void Beat(PgConnection& db);

  const Address& address_;
  Health health_;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable_any changed_;
  bool noticed_ = false;  // a commit, of which `wake` has not heard
  std::string owner_;
  bool beaten_ = false;               // owner_ is in `processes`
  std::int64_t steady_since_ms_ = 0;  // since then every beat came in time; 0: not now
  std::jthread thread_;
};

}  // namespace pliant::postgres
