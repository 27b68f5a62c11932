// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Requests to ClickHouse where what answers is broken, slow, dead or something else.
#include "index/store/clickhouse/http_pool.h"

#include <atomic>
#include <chrono>
#include <memory>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/odd_server.h"
#include "tests/unit/expect_error.h"

namespace pliant::testing {
namespace {

using clickhouse::DatabaseRequest;
using clickhouse::HttpPool;
using clickhouse::HttpPoolOptions;
using std::chrono::milliseconds;
using std::chrono::seconds;
using Clock = std::chrono::steady_clock;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr const char* kException =
    "Code: 60, e.displayText() = DB::Exception: Table pliant.none doesn't exist., "
    "e.what() = DB::Exception\n";

DatabaseRequest Select(bool repeatable = true) {
  DatabaseRequest request;
  request.statement = "SELECT 1";
  request.repeatable = repeatable;
  return request;
}

DatabaseRequest Insert(bool repeatable = false) {
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

OddServer::Answer Echo(const OddServer::Request& request) { return OddServer::Ok(request.body); }

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

TEST_F(HttpPoolTest, ErrorsOfClickHouseAreFoundWhereverTheyStand) {
  const std::string rows(40000, '\1');
  const std::string code = "X-ClickHouse-Exception-Code: 60\r\n";
  OddServer::Answer in_chunks = OddServer::Chunked(rows + kException, 1000);
  OddServer::Answer cut = OddServer::Chunked(rows + kException, 1000);
  cut.bytes.resize(cut.bytes.size() - 5);  // as later versions do: no last chunk
  cut.close = true;
  for (const OddServer::Answer& answer :
       {OddServer::Status("HTTP/1.1 404 Not Found", kException, code),
        OddServer::Status("HTTP/1.1 500 Internal Server Error", kException),
        OddServer::Ok(kException, code), OddServer::Ok(rows + kException, code)}) {
    servers_.clear();
    ServeBytes(answer);
    const std::string sentence = Expect(ErrorCode::kNotFound, "database_table_missing", Select());
    EXPECT_THAT(sentence, HasSubstr("Table pliant.none doesn't exist"));
    EXPECT_THAT(sentence, HasSubstr("127.0.0.1:"));
    Expect(ErrorCode::kNotFound, "database_table_missing", Insert());
  }
  // What announces nothing is an error for who reads the rows and does not understand them.
  const auto read_rows = [](std::string_view piece) {
    if (piece.find("Exception") != std::string_view::npos) {
      throw Error(ErrorCode::kCorrupt, "answer_corrupt", "these are no rows");
    }
  };
  for (const OddServer::Answer& answer : {OddServer::Ok(rows + kException), in_chunks, cut}) {
    servers_.clear();
    ServeBytes(answer);
    ExpectError(ErrorCode::kNotFound, "database_table_missing",
                [&] { pool_->Stream(Select(), read_rows, [] {}); });
    Expect(ErrorCode::kNotFound, "database_table_missing", Insert());
  }
}

TEST_F(HttpPoolTest, WhatIsNotClickHouse) {
  ServeBytes(OddServer::Status("HTTP/1.1 502 Bad Gateway", "<html>nginx</html>"));
  EXPECT_THAT(Expect(ErrorCode::kUnavailable, "database_unavailable", Select()), HasSubstr("502"));
  servers_.clear();
  ServeBytes(OddServer::Status("HTTP/1.1 302 Found", "", "Location: http://127.0.0.1:1/\r\n"));
  EXPECT_THAT(Expect(ErrorCode::kUnavailable, "database_unavailable", Select()), HasSubstr("302"));
}

TEST_F(HttpPoolTest, GarbageIsNoAnswer) {
  for (const std::string& bytes :
       {std::string("SSH-2.0-OpenSSH_9.2\r\n"), std::string("\r\n\r\n"), std::string(100000, 'x'),
        std::string("HTTP/1.1 abc OK\r\n\r\n"), std::string("HTTP/9.9 200 OK\r\n\r\n"),
        std::string("HTTP/1.1 200\r\nContent-Length: -1\r\n\r\nxx"),
        std::string("HTTP/1.1 200 OK\r\nContent-Length: x\r\n\r\nabc"),
        std::string("HTTP/1.1 200 OK\r\nContent-Length: 10\r\n\r\nshort"),
        std::string("HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\nabc\r\n0\r\n\r\n"),
        std::string("HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n5\r\nabc"),
        std::string("HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n"),
        std::string("HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n"
                    "ffffffffffffffffff\r\nabc\r\n0\r\n\r\n"),
        std::string("HTTP/1.1 200 OK\r\n\r\nno length, no chunks"),
        std::string("HTTP/1.1 200 OK\r\nContent-Encoding: gzip\r\nContent-Length: 3\r\n\r\nabc"),
        std::string("\x16\x03\x01\x00\x05hello"), std::string(1, '\0')}) {
    servers_.clear();
    SCOPED_TRACE(bytes.substr(0, 80));
    ServeBytes({.bytes = bytes, .close = true});
    Expect(ErrorCode::kUnavailable, "database_unavailable", Select());
    Expect(ErrorCode::kUnavailable, "database_outcome_unknown", Insert());
  }
}

TEST_F(HttpPoolTest, AnEndlessHeadEnds) {
  std::string head = "HTTP/1.1 200 OK\r\n";
  for (int i = 0; i < 100000; ++i) head += "X-" + std::to_string(i) + ": y\r\n";
  ServeBytes({.bytes = head, .close = true});
  Expect(ErrorCode::kUnavailable, "database_unavailable", Select(), seconds(20));
}

TEST_F(HttpPoolTest, AnswersThatAreTooLarge) {
  for (const OddServer::Answer& answer :
       {OddServer::Ok(std::string(100000, 'x')), OddServer::Chunked(std::string(100000, 'x'), 999),
        OddServer::Answer{.bytes = "HTTP/1.1 200 OK\r\nContent-Length: 9999999999\r\n\r\n" +
                                   std::string(200000, 'x')}}) {
    servers_.clear();
    ServeBytes(answer);
    DatabaseRequest request = Select();
    request.max_answer_bytes = 99999;
    EXPECT_THAT(Expect(ErrorCode::kTooLarge, "database_answer_too_large", request),
                HasSubstr("99999"));
    EXPECT_EQ(asked(0), 1u);
  }
  servers_.clear();
  ServeBytes(OddServer::Chunked(std::string(100000, 'x'), 999));
  DatabaseRequest request = Select();
  request.max_answer_bytes = 100000;
  EXPECT_EQ(Fetch(request).size(), 100000u);
}

TEST_F(HttpPoolTest, AfterTheFirstPieceNoOtherHostIsAsked) {
  const OddServer::Answer cut{.bytes = "HTTP/1.1 200 OK\r\nContent-Length: 10\r\n\r\nshort",
                              .close = true};
  Serve({[cut](const OddServer::Request&) { return cut; }, Echo});
  std::string got;
  bool finished = false;
  ExpectError(ErrorCode::kUnavailable, "database_unavailable", [&] {
    pool_->Stream(
        Select(), [&](std::string_view piece) { got += piece; }, [&] { finished = true; });
  });
  EXPECT_EQ(got, "short");
  EXPECT_FALSE(finished);
  EXPECT_EQ(asked(1), 0u);
  pool_ = std::make_unique<HttpPool>(options_);
  EXPECT_EQ(Fetch(Select()), "SELECT 1") << "what was collected of the first is forgotten";
}

TEST_F(HttpPoolTest, WhatTheReaderThrowsIsThrown) {
  Serve({Echo, Echo});
  struct Odd {};
  EXPECT_THROW(pool_->Stream(
                   Select(), [](std::string_view) { throw Odd(); }, [] {}),
               Odd);
  EXPECT_THROW(pool_->Stream(
                   Select(), [](std::string_view) {}, [] { throw Odd(); }),
               Odd);
  EXPECT_EQ(asked(1), 0u);
  EXPECT_EQ(Fetch(Select()), "SELECT 1");
}

TEST_F(HttpPoolTest, ManyAtOnce) {
  Serve({[](const OddServer::Request& request) {
           OddServer::Answer answer = OddServer::Chunked(request.body + request.body, 1000);
           if (request.number == 7) answer = {.bytes = "", .close = true};
           return answer;
         },
         [](const OddServer::Request& request) {
           return OddServer::Ok(request.body + request.body);
         }});
  std::atomic<int> answered{0};
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < 16; ++i) {
      threads.emplace_back([&, i] {
        for (int n = 0; n < 40; ++n) {
          DatabaseRequest request = Insert(true);
          request.rows = std::to_string(i * 1000 + n) + std::string(5000, 'x');
          EXPECT_EQ(Fetch(request), request.rows + request.rows);
          ++answered;
        }
      });
    }
  }
  EXPECT_EQ(answered, 16 * 40);
  EXPECT_LE(server(0).connections(), 16 + 16 * 40 / 6) << "connections are kept";
}

TEST_F(HttpPoolTest, RequestsThatMakeNoSenseAreNotSent) {
  Serve({Echo});
  const auto refused = [this](auto change) {
    DatabaseRequest request = Select();
    change(request);
    Expect(ErrorCode::kInvalidArgument, "database_request_invalid", request);
  };
  refused([](DatabaseRequest& request) { request.statement.clear(); });
  refused([](DatabaseRequest& request) { request.settings = {{"a&b", "1"}}; });
  refused([](DatabaseRequest& request) { request.tables = {{"a\"b", "w UInt8", ""}}; });
  refused([](DatabaseRequest& request) {
    request.rows = "x";
    request.tables = {{"q", "w UInt8", ""}};
  });
  refused([](DatabaseRequest& request) {
    request.rows = "x";
    request.statement.assign(20000, 'x');
  });
  EXPECT_EQ(asked(0), 0u);
}

}  // namespace
}  // namespace pliant::testing
