// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Answers to requests to ClickHouse that are errors, broken, too large or something else.
#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/http_pool_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;

constexpr const char* kException =
    "Code: 60, e.displayText() = DB::Exception: Table pliant.none doesn't exist., "
    "e.what() = DB::Exception\n";

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
