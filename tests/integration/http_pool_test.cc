// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Requests to ClickHouse where what answers is slow, dead or asked by many.
#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/http_pool_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

TEST_F(HttpPoolTest, ConnectionsAreKept) {
  Serve({Echo});
  for (int i = 0; i < 5; ++i) EXPECT_EQ(Fetch(Select()), "SELECT 1");
  EXPECT_EQ(Fetch(Insert()), Insert().rows);
  EXPECT_EQ(server(0).connections(), 1);
  const std::string head = server(0).requests().back().head;
  EXPECT_THAT(head, StartsWith("POST /?wait_end_of_query=1"));
  EXPECT_THAT(head, HasSubstr("query=INSERT%20INTO%20t%20FORMAT%20Native"));
}

TEST_F(HttpPoolTest, AKeptConnectionThatTheServerHasClosedIsNoFailure) {
  Serve({[](const OddServer::Request& request) {
    OddServer::Answer answer = Echo(request);
    answer.close = true;  // without having said so
    return answer;
  }});
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(Fetch(Insert()), Insert().rows) << i;
    std::this_thread::sleep_for(milliseconds(100));  // until the good-bye has come
  }
  EXPECT_EQ(asked(0), 3u);
}

TEST_F(HttpPoolTest, PasswordAndUserAreInTheHeadAndNowhereElse) {
  Serve({Echo});
  options_.user = "pliant";
  options_.password = "open sesame";
  pool_ = std::make_unique<HttpPool>(options_);
  Fetch(Select());
  const std::string head = server(0).requests().back().head;
  EXPECT_THAT(head, HasSubstr("X-ClickHouse-User: pliant\r\n"));
  EXPECT_THAT(head, HasSubstr("X-ClickHouse-Key: open sesame\r\n"));
  EXPECT_THAT(head.substr(0, head.find("\r\n")), Not(HasSubstr("sesame")));
}

TEST_F(HttpPoolTest, TheNextHostIsAskedAndTheFirstOneLeftAloneForAWhile) {
  Serve({Echo, Echo});
  servers_[0].reset();  // nobody listens there any more
  for (int i = 0; i < 3; ++i) EXPECT_EQ(Fetch(Insert()), Insert().rows);
  EXPECT_EQ(asked(1), 3u);
  servers_[1].reset();
  EXPECT_THAT(Expect(ErrorCode::kUnavailable, "database_unavailable", Insert()),
              HasSubstr("none of 2 hosts"));
}

TEST_F(HttpPoolTest, AHostThatFailedComesLast) {
  std::atomic<bool> broken{true};
  Serve({[&broken](const OddServer::Request& request) {
           OddServer::Answer answer = Echo(request);
           if (broken) answer = {.bytes = "", .close = true};
           return answer;
         },
         Echo});
  EXPECT_EQ(Fetch(Select()), "SELECT 1");
  EXPECT_EQ(asked(0), 1u);
  broken = false;
  for (int i = 0; i < 5; ++i) Fetch(Select());
  EXPECT_EQ(asked(0), 1u) << "it failed just now";
  EXPECT_EQ(asked(1), 6u);
}

TEST_F(HttpPoolTest, WhatMayHaveBeenDoneIsNotAskedTwice) {
  const OddServer::Answer hang_up{.bytes = "", .close = true};
  const OddServer::Answer reset{.bytes = "", .reset = true};
  const OddServer::Answer half{.bytes = "HTTP/1.1 200 OK\r\nContent-Le", .close = true};
  for (const OddServer::Answer& answer : {hang_up, reset, half}) {
    servers_.clear();
    Serve({[answer](const OddServer::Request&) { return answer; }, Echo});
    EXPECT_THAT(Expect(ErrorCode::kUnavailable, "database_outcome_unknown", Insert()),
                HasSubstr("may have been done"));
    EXPECT_EQ(asked(0), 1u);
    EXPECT_EQ(asked(1), 0u);
    pool_ = std::make_unique<HttpPool>(options_);
    EXPECT_EQ(Fetch(Insert(true)), Insert().rows);
    EXPECT_EQ(asked(0), 2u) << "once a host";
    EXPECT_EQ(asked(1), 1u);
  }
}

TEST_F(HttpPoolTest, AHostThatClosesBeforeItReads) {
  Serve({Echo, Echo});
  server(0).HangUp();
  DatabaseRequest large = Insert();
  large.rows.assign(std::size_t{8} << 20, 'x');
  Expect(ErrorCode::kUnavailable, "database_outcome_unknown", large);
  pool_ = std::make_unique<HttpPool>(options_);
  large.repeatable = true;
  EXPECT_EQ(Fetch(large).size(), large.rows.size());
  EXPECT_EQ(asked(0), 0u);
}

TEST_F(HttpPoolTest, AnswersThatDripEndWithTheTimeout) {
  OddServer::Answer drips = OddServer::Ok(std::string(1000, 'x'));
  drips.each_byte = milliseconds(30);
  ServeBytes(drips);
  DatabaseRequest request = Select();
  request.timeout = milliseconds(400);
  EXPECT_THAT(Expect(ErrorCode::kUnavailable, "database_timeout", request),
              HasSubstr("within 400 ms"));
  request.repeatable = false;
  Expect(ErrorCode::kUnavailable, "database_outcome_unknown", request);
}

TEST_F(HttpPoolTest, AHostThatIsSilentLeavesTheOthersTheirShareOfTheTime) {
  OddServer::Answer late = OddServer::Ok("late");
  late.before = seconds(30);
  Serve({[late](const OddServer::Request&) { return late; }, Echo});
  DatabaseRequest request = Select();
  request.timeout = milliseconds(1000);
  const auto before = Clock::now();
  EXPECT_EQ(Fetch(request), "SELECT 1");
  EXPECT_GE(Clock::now() - before, milliseconds(400));
  EXPECT_LT(Clock::now() - before, milliseconds(1000));
}

TEST_F(HttpPoolTest, ARequestCanBeCancelledInTheMiddle) {
  OddServer::Answer drips = OddServer::Ok(std::string(10000, 'x'));
  drips.each_byte = milliseconds(5);
  OddServer::Answer late = OddServer::Ok("late");
  late.before = seconds(30);
  for (const OddServer::Answer& answer : {drips, late}) {
    servers_.clear();
    ServeBytes(answer);
    std::stop_source stop;
    DatabaseRequest request = Insert();
    request.stop = stop.get_token();
    const std::jthread stopper([&stop] {
      std::this_thread::sleep_for(milliseconds(200));
      stop.request_stop();
    });
    Expect(ErrorCode::kCancelled, "cancelled", request, seconds(2));
    Expect(ErrorCode::kCancelled, "cancelled", request, seconds(1));  // before it began
    EXPECT_EQ(asked(0), 1u);
  }
}

}  // namespace
}  // namespace pliant::testing
