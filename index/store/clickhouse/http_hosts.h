// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The connections of an HttpPool. Only http_pool.cc and what stands beside it see the HTTP library.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <vector>

#include <httplib.h>

#include "index/store/clickhouse/http_pool.h"

namespace pliant::clickhouse {

// Thread-safe.
class HttpHosts {
 public:
  using Connection = std::unique_ptr<httplib::ClientImpl>;

  explicit HttpHosts(const HttpPoolOptions& options);

  // All hosts, those that failed within the last seconds at the end.
  std::vector<std::size_t> Order() const;
  void Failed(std::size_t host);
  void Answered(std::size_t host);

  Connection Take(std::size_t host);  // a kept one, or a new one that is not connected yet
  void Give(std::size_t host, Connection connection);  // one whose last request went well

 private:
  using Clock = std::chrono::steady_clock;
  struct Kept {
    Connection connection;
    Clock::time_point since;
  };
  struct Host {
    std::mutex mutex;  // guards kept
    std::vector<Kept> kept;
    std::atomic<std::int64_t> failed_at_ms{INT64_MIN};
  };

  Connection Make(std::size_t host) const;

  const HttpPoolOptions& options_;
  std::deque<Host> hosts_;
};

}  // namespace pliant::clickhouse
