// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What is not HTTP, or comes too slowly: answered, closed, and the server goes on working; and odd
// HTTP that is right.
#include <chrono>
#include <sstream>

#include <gmock/gmock.h>

#include "tests/integration/server_errors_fixture.h"

namespace pliant::testing {
namespace {

TEST_F(ServerErrorsTest, BrokenHttp) {
  const std::string host = "Host: localhost\r\n";
  const std::string post =
      "POST " + std::string(kImages) + " HTTP/1.1\r\n" + host + "Content-Type: image/png\r\n";
  struct Case {
    const char* what;
    std::string bytes;
    int status;
    std::string code;
  };
  std::string many_headers = "GET /livez HTTP/1.1\r\n" + host;
  for (int i = 0; i < 3000; ++i) many_headers += "X-H" + std::to_string(i) + ": y\r\n";
  std::string ranges = "Range: bytes=0-0";
  for (int i = 0; i < 1300; ++i) ranges += ",0-0";
  const std::vector<Case> cases = {
      {"not HTTP", "hello\r\n\r\n", 400, "bad_request"},
      {"unknown method", "BREW / HTTP/1.1\r\n" + host + "\r\n", 400, "bad_request"},
      {"no Host", "GET /livez HTTP/1.1\r\n\r\n", 400, "bad_request"},
      {"two Hosts", "GET /livez HTTP/1.1\r\n" + host + host + "\r\n", 400, "bad_request"},
      {"no path", "GET livez HTTP/1.1\r\n" + host + "\r\n", 400, "bad_request"},
      {"many headers", many_headers + "\r\n", 431, "headers_too_large"},
      {"long header",
       "GET /livez HTTP/1.1\r\n" + host + "X: " + std::string(9000, 'y') + "\r\n\r\n", 400,
       "bad_request"},
      {"bare line feeds", std::string(100, '\n'), 400, "bad_request"},
      {"blank lines without end",
       [] {
         std::string lines;
         for (int i = 0; i < 200'000; ++i) lines += "\r\n";
         return lines;
       }(),
       431, "headers_too_large"},
      {"long request line", "GET /" + std::string(20'000, 'a'), 431, "headers_too_large"},
      {"request line never ends", "GET /livez", 408, "request_timeout"},
      {"two lengths", post + "Content-Length: 1\r\nContent-Length: 2\r\n\r\nxx", 400,
       "bad_request"},
      {"length and chunks",
       post + "Content-Length: 3\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 400,
       "bad_request"},
      {"length no number", post + "Content-Length: 1x\r\n\r\nx", 400, "bad_request"},
      {"length negative", post + "Content-Length: -1\r\n\r\nx", 400, "bad_request"},
      {"length enormous", post + "Content-Length: 99999999999999999999999\r\n\r\n", 413,
       "body_too_large"},
      {"length too large", post + "Content-Length: 9999999999\r\n\r\n", 413, "body_too_large"},
      {"too large, asks first", post + "Expect: 100-continue\r\nContent-Length: 9999999999\r\n\r\n",
       413, "body_too_large"},
      {"odd encoding", post + "Transfer-Encoding: gzip\r\n\r\n", 501,
       "unsupported_transfer_encoding"},
      {"compressed", post + "Content-Encoding: gzip\r\nContent-Length: 2\r\n\r\nxx", 415,
       "unsupported_content_encoding"},
      {"chunks are not chunks", post + "Transfer-Encoding: chunked\r\n\r\nzz\r\n\r\n", 400,
       "bad_request"},
      {"endless chunk line",
       post + "Transfer-Encoding: chunked\r\n\r\n" + std::string(1'300'000, '1'), 413,
       "body_too_large"},
      {"chunk too large",
       post + "Transfer-Encoding: chunked\r\n\r\n7fffffff\r\n" + std::string(1'300'000, 'x'), 413,
       "body_too_large"},
      {"body never ends", post + "Content-Length: 500\r\n\r\nxx", 408, "request_timeout"},
      {"headers never end", "GET /livez HTTP/1.1\r\n" + host, 408, "request_timeout"},
  };
  for (const Case& wrong : cases) {
    SCOPED_TRACE(wrong.what);
    const std::string answer = server_->Talk(wrong.bytes);
    EXPECT_THAT(answer, ::testing::StartsWith("HTTP/1.1 " + std::to_string(wrong.status) + " "));
    EXPECT_THAT(answer, ::testing::HasSubstr("\"code\":\"" + wrong.code + "\""));
    EXPECT_THAT(answer, ::testing::HasSubstr("X-Request-Id: "));
    EXPECT_THAT(answer, ::testing::HasSubstr("Connection: close"));
    EXPECT_THAT(answer, ::testing::HasSubstr("application/problem+json"));
  }
  // Many ranges are no way to make the answer grow.
  const std::string get = "GET / HTTP/1.1\r\n" + host + "Connection: close\r\n";
  const std::string whole = server_->Talk(get + "\r\n");
  const std::string ranged = server_->Talk(get + ranges + "\r\n\r\n");
  EXPECT_THAT(ranged, ::testing::StartsWith("HTTP/1.1 200 "));
  EXPECT_EQ(ranged.size(), whole.size());
  ExpectAlive();
}

// The body of a request must never be run as the next one, whatever a program in front thinks where
// it ends: refused with 400, and the connection closed.
TEST_F(ServerErrorsTest, NoRequestHidesInAnother) {
  const std::string hidden = "GET /v1/collections HTTP/1.1\r\nHost: localhost\r\n\r\n";
  const std::string length = std::to_string(hidden.size());
  const std::string line = "POST " + std::string(kImages) + " HTTP/1.1\r\n";
  const std::string host = "Host: localhost\r\nContent-Type: image/png\r\n";
  const std::string nul(1, '\0');
  for (const std::string& head : {
           line + host + "Content-Length : " + length + "\r\n\r\n",
           line + host + "Content-Length\t: " + length + "\r\n\r\n",
           line + host + " Content-Length: " + length + "\r\n\r\n",
           line + host + "X: a\r\n\tContent-Length: " + length + "\r\n\r\n",
           line + host + "Content-Length: 0\r\nContent-Length: " + length + "\r\n\r\n",
           line + host + "Content-Length: +" + length + "\r\n\r\n",
           line + host + "Transfer-Encoding : chunked\r\n\r\n0\r\n\r\n",
           line + host + "Transfer-Encoding:\vchunked\r\n\r\n0\r\n\r\n",
           line + host + "Transfer-Encoding: chunked\r\nTransfer-Encoding: x\r\n\r\n0\r\n\r\n",
           line + host + "Content-Length: 5\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
           line + host + "Transfer-Encoding: chunked\r\n\r\n0x0\r\n\r\n",
           line + host + "Transfer-Encoding: chunked\r\n\r\n-5\r\n\r\n",
           line + host + "Transfer-Encoding: chunked\r\n\r\n0 \r\n\r\n",
           line + host + "Transfer-Encoding: chunked\r\n\r\n0\n\r\n",
           line + host + "X: a" + nul + "\r\n\r\n",
           line + host + "X: a\nContent-Length: " + length + "\r\n\r\n",
           line + host + "X: a\rContent-Length: " + length + "\r\n\r\n",
           "POST " + std::string(kImages) + " HTTP/1.1\nHost: localhost\n\n",
       }) {
    SCOPED_TRACE(head);
    const std::string answer = server_->Talk(head + hidden);
    EXPECT_THAT(answer, ::testing::StartsWith("HTTP/1.1 400 "));
    EXPECT_THAT(answer, ::testing::HasSubstr("Connection: close"));
    EXPECT_EQ(answer.find("HTTP/1.1", 1), std::string::npos) << answer;
  }
  ExpectAlive();
}

TEST_F(ServerErrorsTest, RequestsMayFollowOneAnother) {
  const std::string get = "GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n";
  const std::string put = "PUT " + std::string(kImages) +
                          "/one?object=o HTTP/1.1\r\nHost: localhost\r\nContent-Type: image/png\r\n"
                          "Content-Length: " +
                          std::to_string(image_.size()) + "\r\n\r\n" + image_;
  const std::string answers =
      server_->Talk(get + "\r\n" + put + get +
                    "GET /livez HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  int count = 0;
  for (std::size_t at = answers.find("HTTP/1.1 200 "); at != std::string::npos;
       at = answers.find("HTTP/1.1 200 ", at + 1)) {
    ++count;
  }
  EXPECT_EQ(count, 4) << answers;
}

TEST_F(ServerErrorsTest, ChunkedBodiesAndContinueWork) {
  const std::string head = "PUT " + std::string(kImages) +
                           "/one?object=o HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
                           "Content-Type: image/png\r\n";
  std::ostringstream chunked;
  chunked << head << "Transfer-Encoding: chunked\r\n\r\n"
          << std::hex << image_.size() << "\r\n"
          << image_ << "\r\n0\r\n\r\n";
  EXPECT_THAT(server_->Talk(chunked.str()), ::testing::StartsWith("HTTP/1.1 200 "));
  const std::string expecting =
      head + "Expect: 100-continue\r\nContent-Length: " + std::to_string(image_.size()) +
      "\r\n\r\n" + image_;
  const std::string answer = server_->Talk(expecting);
  EXPECT_THAT(answer, ::testing::StartsWith("HTTP/1.1 100 "));
  EXPECT_THAT(answer, ::testing::HasSubstr("HTTP/1.1 200 "));
}

// A client that sends byte by byte holds a thread no longer than the deadline allows, although each
// byte comes in good time.
TEST_F(ServerErrorsTest, SlowClientsAreCutOff) {
  const std::string post = "POST " + std::string(kImages) + " HTTP/1.1\r\nHost: localhost\r\n";
  const std::chrono::milliseconds patience(20'000);
  for (const std::string& head :
       {post + "Content-Type: image/png\r\nContent-Length: 1000\r\n\r\n", post + "X-Long: "}) {
    const auto start = std::chrono::steady_clock::now();
    EXPECT_THAT(server_->Talk(head, patience, true), ::testing::StartsWith("HTTP/1.1 408 "));
    EXPECT_LT(std::chrono::steady_clock::now() - start, patience) << "it was not cut off";
  }
}

}  // namespace
}  // namespace pliant::testing
