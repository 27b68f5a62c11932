// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Requests to the HTTP interface of several ClickHouse servers, over connections that are kept.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "index/store/clickhouse/database_url.h"

namespace pliant::clickhouse {

struct HttpPoolOptions {
  std::vector<HostPort> hosts;  // asked in this order; those that failed lately, last
  bool tls = false;
  std::string ca_file;                              // empty: the system's certificates
  std::string user;                                 // empty: none is sent
  std::string password;                             // without control characters
  std::chrono::milliseconds connect_timeout{2000};  // to one host
  std::chrono::milliseconds timeout{30000};         // of a request, all hosts together
};

// A table that goes along with a statement and lives as long as it.
struct ExternalTable {
  std::string name;
  std::string structure;  // "w UInt32, s UInt64"
  std::string rows;       // Native blocks
};

struct DatabaseRequest {
  std::string statement;
  std::string rows;  // what an INSERT ... FORMAT Native puts in; not with tables
  std::vector<ExternalTable> tables;
  std::vector<std::pair<std::string, std::string>> settings;  // of ClickHouse, for this statement
  // Asking twice does no harm: another host is asked when one does not answer. Else only when the
  // statement has certainly not reached the first.
  bool repeatable = false;
  std::chrono::milliseconds timeout{0};  // 0: the pool's
  std::stop_token stop;                  // then kCancelled
  std::uint64_t max_answer_bytes = std::uint64_t{1} << 30;
};

// Thread-safe. No lock is held while a request runs. All functions throw
//   kUnavailable "database_unavailable" (no host answers), "database_timeout",
//   "database_outcome_unknown" (it may have been done), kCancelled "cancelled",
//   kTooLarge "database_answer_too_large", kInvalidArgument "database_request_invalid",
//   and what ToError (server_error.h) makes of ClickHouse's own errors, also of those that come
//   after the first bytes of an answer.
class HttpPool {
 public:
  // Connects to nobody yet.
  explicit HttpPool(HttpPoolOptions options);
  ~HttpPool();
  HttpPool(const HttpPool&) = delete;
  HttpPool& operator=(const HttpPool&) = delete;

  std::string Fetch(const DatabaseRequest& request);

  // The answer in pieces, as it comes, and `finish` at its end. What they throw is thrown, unless
  // the answer turns out to end with an error of ClickHouse. No other host is asked once a piece
  // was given away.
  void Stream(const DatabaseRequest& request, const std::function<void(std::string_view)>& take,
              const std::function<void()>& finish);

 private:
  class Hosts;
  struct Attempt;

  enum class Outcome { kDone, kNotSent, kNoAnswer };
  using Clock = std::chrono::steady_clock;

  void Run(const DatabaseRequest& request, Attempt& attempt);
  Outcome Try(std::size_t host, const DatabaseRequest& request, Clock::time_point until,
              Attempt& attempt);

  HttpPoolOptions options_;
  std::unique_ptr<Hosts> hosts_;
};

}  // namespace pliant::clickhouse
