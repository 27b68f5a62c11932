// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <random>

#include <gtest/gtest.h>

#include "server/http/request_reader.h"
#include "tests/unit/problem_of.h"

namespace pliant::server {
namespace {

Request HeadOf(const std::string& text) {
  Request head;
  ReadRequestHead(text, head);
  return head;
}

// The code of the refusal; empty = accepted.
std::string CodeOf(const std::string& fields, const std::string& line = "POST /x HTTP/1.1") {
  return ProblemOf([&] { HeadOf(line + "\r\nHost: a\r\n" + fields + "\r\n"); }).code;
}

TEST(RequestHead, ReadsFraming) {
  EXPECT_EQ(HeadOf("GET / HTTP/1.1\r\nHost: a\r\n\r\n").framing, BodyFraming::kNone);
  const std::string head = "PUT /a?b=c HTTP/1.1\r\nhOsT: a\r\ncontent-LENGTH:\t 69 \r\n\r\n";
  const Request length = HeadOf(head);
  EXPECT_EQ(length.framing, BodyFraming::kLength);
  EXPECT_EQ(length.length, 69U);
  EXPECT_EQ(length.target, "/a?b=c");
  const std::string put = "PUT / HTTP/1.1\r\nHost: a\r\n";
  EXPECT_EQ(HeadOf(put + "Transfer-Encoding: Chunked\r\n\r\n").framing, BodyFraming::kChunked);
  EXPECT_EQ(HeadOf(put + "Content-Length: 0\r\n\r\n").framing, BodyFraming::kNone);
  EXPECT_GT(HeadOf(put + "Content-Length: 99999999999999999999\r\n\r\n").length,
            std::uint64_t{1} << 59);
}

// What programs in front of a server are known to understand in another way than the server.
TEST(RequestHead, RefusesWhatCanBeReadInTwoWays) {
  const std::string nul(1, '\0');
  for (const std::string& fields : {
           std::string("Content-Length : 69\r\n"),
           std::string("Content-Length\t: 69\r\n"),
           std::string(" Content-Length: 69\r\n"),
           std::string("X: a\r\n Content-Length: 69\r\n"),
           std::string("X: a\r\n\tb\r\n"),
           std::string("Content-Length: 6 9\r\n"),
           std::string("Content-Length: +69\r\n"),
           std::string("Content-Length: -69\r\n"),
           std::string("Content-Length: 0x45\r\n"),
           std::string("Content-Length: 69,69\r\n"),
           std::string("Content-Length: \r\n"),
           std::string("Content-Length: 69\v\r\n"),
           std::string("Content-Length: 69\r\nContent-Length: 69\r\n"),
           std::string("Content-Length: 0\r\nContent-Length: 69\r\n"),
           std::string("Content-Length: 69\r\nTransfer-Encoding: chunked\r\n"),
           std::string("Transfer-Encoding: chunked\r\nTransfer-Encoding: identity\r\n"),
           std::string("Transfer-Encoding : chunked\r\n"),
           std::string("Transfer-Encoding\v: chunked\r\n"),
           std::string("Transfer-Encoding:\vchunked\r\n"),
           std::string("Transfer-Encoding: chunked\r\nContent-Length : 4\r\n"),
           std::string("X: a\nContent-Length: 69\r\n"),
           std::string("X: a\rContent-Length: 69\r\n"),
           std::string("X: a\n\r\n"),
           "X: a" + nul + "b\r\n",
           "X" + nul + ": a\r\n",
           std::string("no colon\r\n"),
           std::string(": no name\r\n"),
           std::string("X[]: a\r\n"),
           std::string("X\x80: a\r\n"),
       }) {
    EXPECT_EQ(CodeOf(fields), "bad_request") << fields;
  }
  EXPECT_EQ(CodeOf("Transfer-Encoding: chunked\r\n", "POST /x HTTP/1.0"), "bad_request")
      << "RFC 9112, 6.1";
  EXPECT_EQ(CodeOf("", "POST  /x HTTP/1.1"), "bad_request");
  EXPECT_EQ(CodeOf("", "POST /x y HTTP/1.1"), "bad_request");
  EXPECT_EQ(CodeOf("", " POST /x HTTP/1.1"), "bad_request");
  EXPECT_EQ(CodeOf("", "PO\tST /x HTTP/1.1"), "bad_request");
  EXPECT_EQ(CodeOf("Transfer-Encoding: gzip\r\n"), "unsupported_transfer_encoding");
}

TEST(RequestHead, LeavesOtherOddThingsAlone) {
  for (const char* fields :
       {"X:\r\n", "X: \t \r\n", "X:a:b\r\n", "X: caf\xC3\xA9\r\n", "X-1_2~: \"q\"\r\n"}) {
    EXPECT_EQ(CodeOf(fields), "") << fields;
  }
}

TEST(RequestHead, FindsItsEnd) {
  const std::string text = "GET / HTTP/1.1\r\n\r\nrest";
  EXPECT_EQ(EndOfHead(text, 0), 18U);
  for (std::size_t from = 0; from <= 17; ++from) EXPECT_EQ(EndOfHead(text, from), 18U) << from;
  EXPECT_EQ(EndOfHead("GET / HTTP/1.1\r\n\r", 0), std::string::npos);
}

using State = ChunkedBody::State;

// The state after the text, given in pieces of so many bytes, and the bytes that belong to it.
std::pair<State, std::size_t> Follow(const std::string& text, std::size_t piece,
                                     std::uint64_t most = 1000, std::string* content = nullptr) {
  ChunkedBody body(most);
  if (content != nullptr) content->clear();
  std::size_t total = 0;
  State state = State::kGoesOn;
  for (std::size_t at = 0; at < text.size() && state == State::kGoesOn; at += piece) {
    std::size_t used = 0;
    state = body.Take(std::string_view(text).substr(at, piece), &used, content);
    total += used;
  }
  return {state, total};
}

TEST(ChunkedBody, EndsWhereItEnds) {
  const std::string body = "4\r\nabcd\r\n0A;name=\"v\"\r\n0123456789\r\n0\r\n\r\n";
  for (std::size_t piece = 1; piece < body.size() + 9; ++piece) {
    std::string content;
    EXPECT_EQ(Follow(body + "GET / HTTP/1.1", piece, 1000, &content),
              std::pair(State::kEnded, body.size()))
        << piece;
    EXPECT_EQ(content, "abcd0123456789");
  }
  EXPECT_EQ(Follow(body.substr(0, body.size() - 1), 3).first, State::kGoesOn);
}

TEST(ChunkedBody, RefusesWhatCanBeReadInTwoWays) {
  for (const char* text :
       {"0x3\r\nabc\r\n0\r\n\r\n", "-5\r\n", "+3\r\nabc\r\n", " 3\r\nabc\r\n", "3 \r\nabc\r\n",
        "\r\n", "3\nabc\r\n", "3\r\nabcd\r\n", "3\r\nabc\n0\r\n", "3;\nx\r\nabc\r\n", "3\rabc",
        "zz\r\n", ";x\r\n", "0\r\nTrailer: x\r\n\r\n", "0\r\n\n", "0\n\n"}) {
    EXPECT_EQ(Follow(text, 100).first, State::kBroken) << text;
    EXPECT_EQ(Follow(text, 1).first, State::kBroken) << text;
  }
  EXPECT_EQ(Follow("1;" + std::string(5000, 'x'), 7).first, State::kBroken);
}

TEST(ChunkedBody, IsBounded) {
  EXPECT_EQ(Follow("3e8\r\n" + std::string(1000, 'x') + "\r\n0\r\n\r\n", 64).first, State::kEnded);
  EXPECT_EQ(Follow("3e9\r\n", 64).first, State::kTooLarge);
  EXPECT_EQ(Follow("3e8\r\n" + std::string(1000, 'x') + "\r\n1\r\n", 64).first, State::kTooLarge);
  EXPECT_EQ(Follow("ffffffffffffffffffffffff\r\n", 64).first, State::kTooLarge);
  EXPECT_EQ(Follow(std::string(500, '0') + "1\r\na\r\n0\r\n\r\n", 64).first, State::kEnded);
}

TEST(RequestHead, AnythingIsReadWithoutFail) {
  constexpr unsigned kSeed = 11;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  const std::string base = "POST /x HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\n\r\n";
  for (int round = 0; round < 20'000; ++round) {
    std::string text = base;
    for (int i = 0; i < 3; ++i) text[random() % text.size()] = static_cast<char>(random());
    Request head;
    ProblemOf([&] { ReadRequestHead(text, head); });
    EXPECT_LE(head.target.size(), text.size());
    std::size_t used = 0;
    ChunkedBody body(100);
    body.Take(text, &used);
    EXPECT_LE(used, text.size());
  }
}

}  // namespace
}  // namespace pliant::server
