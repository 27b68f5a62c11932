// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Hosts that answer as a test says, and a pool that asks them.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "index/store/clickhouse/http_pool.h"
#include "tests/integration/odd_server.h"
#include "tests/unit/expect_error.h"

namespace pliant::testing {

using clickhouse::DatabaseRequest;
using clickhouse::HttpPool;
using clickhouse::HttpPoolOptions;
using std::chrono::milliseconds;
using std::chrono::seconds;
using Clock = std::chrono::steady_clock;

inline DatabaseRequest Select(bool repeatable = true) {
  DatabaseRequest request;
  request.statement = "SELECT 1";
  request.repeatable = repeatable;
  return request;
}

inline DatabaseRequest Insert(bool repeatable = false) {
  DatabaseRequest request;
  request.statement = "INSERT INTO t FORMAT Native";
  request.rows = std::string("rows\0\r\n\r\n", 9);
  request.repeatable = repeatable;
  return request;
}

class HttpPoolTest : public ::testing::Test {
 protected:
  using Answers = std::function<OddServer::Answer(const OddServer::Request&)>;

  // Hosts that answer like this, and a pool that asks them in this order.
  void Serve(std::vector<Answers> answers) {
    HttpPoolOptions options;
    for (Answers& answer : answers) {
      servers_.push_back(std::make_unique<OddServer>(std::move(answer)));
      options.hosts.push_back({"127.0.0.1", servers_.back()->port()});
    }
    options.timeout = milliseconds(5000);
    options_ = options;
    pool_ = std::make_unique<HttpPool>(options);
  }

  // All hosts answer this.
  void ServeBytes(const OddServer::Answer& answer) {
    Serve({[answer](const OddServer::Request&) { return answer; }});
  }

  OddServer& server(std::size_t host) { return *servers_[host]; }
  std::size_t asked(std::size_t host) const { return servers_[host]->requests().size(); }

  std::string Fetch(const DatabaseRequest& request) { return pool_->Fetch(request); }

  // The sentence.
  std::string Expect(ErrorCode code, const std::string& reason, const DatabaseRequest& request,
                     milliseconds within = seconds(3)) {
    const auto before = Clock::now();
    std::string sentence;
    ExpectError(code, reason, [&] {
      try {
        const std::string got = Fetch(request);
        ADD_FAILURE() << "answered " << got.substr(0, 100);
      } catch (const Error& error) {
        sentence = error.what();
        throw;
      }
    });
    EXPECT_LT(Clock::now() - before, within) << sentence;
    return sentence;
  }

  HttpPoolOptions options_;
  std::vector<std::unique_ptr<OddServer>> servers_;
  std::unique_ptr<HttpPool> pool_;
};

inline OddServer::Answer Echo(const OddServer::Request& request) {
  return OddServer::Ok(request.body);
}

}  // namespace pliant::testing
