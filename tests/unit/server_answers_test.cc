// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Compression and conditions of answers, without a socket.
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/http/compression.h"
#include "server/http/conditions.h"
#include "tests/unit/problem_of.h"

namespace pliant::server {
namespace {

Request Asking(std::multimap<std::string, std::string, HeaderNameLess> headers) {
  Request request;
  request.method = "GET";
  request.headers = std::move(headers);
  return request;
}

Response JsonOf(std::size_t bytes) {
  Response response;
  response.content_type = "application/json";
  response.body.assign(bytes, 'a');
  response.headers = {{"ETag", "\"x\""}};
  return response;
}

std::string HeaderOf(const Response& response, const std::string& name) {
  for (const auto& [header, value] : response.headers) {
    if (header == name) return value;
  }
  return {};
}

TEST(Compression, PrefersWhatTheClientPrefers) {
  for (const char* gzip : {"gzip, br", "GZIP;Q=0.001", "*;q=0.5", "x-gzip", "gzip, identity",
                           "gzip;q=0.5, *;q=0", "identity;q=0.5, *"}) {
    EXPECT_TRUE(PrefersGzip(gzip)) << gzip;
  }
  for (const char* none : {"*;q=0", "gzip;q=0, *", "identity;q=0.6, gzip;q=0.5", "br", "", ",",
                           "gzip;", "gzip;q", "gzip;q=", "gzip;q=1.1", "gzip;q=-1", "gzip;q=0.5x",
                           "gzip;level=1", "gzipp", "compress, deflate"}) {
    EXPECT_FALSE(PrefersGzip(none)) << none;
  }
  // Whatever comes is read.
  std::mt19937 random(5);
  for (int i = 0; i < 2000; ++i) {
    std::string text;
    for (std::size_t n = random() % 30; n > 0; --n) text += "gzipbr*;q=01.,\t \xff"[random() % 17];
    const auto weights = WeightsOf(text);
    EXPECT_TRUE(!PrefersGzip(text) || weights.contains("gzip") || weights.contains("*")) << text;
  }
}

TEST(Accept, ListsWeights) {
  using ::testing::ElementsAre;
  using ::testing::Pair;
  EXPECT_THAT(WeightsOf("image/PNG;q=0.5, image/jpeg, image/png, a;b=1, c;q=2,"),
              ElementsAre(Pair("image/jpeg", 1000), Pair("image/png", 500)));
}

TEST(Compression, TakesTextOnly) {
  for (const char* type : {"application/json", "Application/JSON; charset=utf-8", "text/html",
                           "application/problem+json", "text/plain; version=0.0.4"}) {
    EXPECT_TRUE(IsCompressible(type)) << type;
  }
  for (const char* type : {"", "image/png", "image/jpeg", "application/octet-stream", "textual"}) {
    EXPECT_FALSE(IsCompressible(type)) << type;
  }
}

TEST(Compression, HasLimits) {
  Compressor none_long(0);
  const Request request = Asking({{"Accept-Encoding", "gzip"}});
  Response small = JsonOf(Compressor::kFewestBytes - 1);
  none_long.Compress(request, small);
  EXPECT_EQ(HeaderOf(small, "Content-Encoding"), "");
  EXPECT_EQ(HeaderOf(small, "Vary"), "Accept-Encoding");
  Response middle = JsonOf(Compressor::kFewestBytes);
  none_long.Compress(request, middle);
  EXPECT_EQ(HeaderOf(middle, "Content-Encoding"), "gzip");
  EXPECT_EQ(HeaderOf(middle, "ETag"), "\"x-gzip\"");
  Response large = JsonOf(Compressor::kLongBytes);
  none_long.Compress(request, large);
  EXPECT_EQ(HeaderOf(large, "Content-Encoding"), "") << "no core is free for long ones";
  EXPECT_EQ(large.body.size(), Compressor::kLongBytes);
  Compressor one(1);
  for (int i = 0; i < 3; ++i) {  // the core is given back
    Response again = JsonOf(Compressor::kLongBytes);
    one.Compress(request, again);
    EXPECT_EQ(HeaderOf(again, "Content-Encoding"), "gzip");
  }
  Response partial = JsonOf(5000);
  partial.status = 206;
  one.Compress(request, partial);
  EXPECT_EQ(HeaderOf(partial, "Content-Encoding"), "");
  // What does not get smaller stays.
  Response noise = JsonOf(0);
  std::mt19937 random(6);
  for (int i = 0; i < 3000; ++i) noise.body += static_cast<char>(random());
  one.Compress(request, noise);
  EXPECT_EQ(HeaderOf(noise, "Content-Encoding"), "");
}

TEST(Conditions, ReadListsOfTags) {
  const std::string etag = "\"abc\"";
  for (const char* list : {"\"abc\"", "\"x\", \"abc\"", "*", "\"abc-gzip\"", ",\"x,y\",\t\"abc\"",
                           "W/\"abc\", \"abc\""}) {
    EXPECT_TRUE(IfMatchHolds(Asking({{"If-Match", list}}), etag)) << list;
    EXPECT_FALSE(NamedByIfNoneMatch(Asking({{"If-None-Match", list}}), etag).empty()) << list;
  }
  for (const char* list : {"", "abc", "\"ab\"", "\"abc", "\"abcd\"", "\"x\" abc", "\"ABC\"",
                           "\"abc-x\"", "\"-gzip\""}) {
    EXPECT_FALSE(IfMatchHolds(Asking({{"If-Match", list}}), etag)) << list;
    EXPECT_EQ(NamedByIfNoneMatch(Asking({{"If-None-Match", list}}), etag), "") << list;
  }
  EXPECT_FALSE(IfMatchHolds(Asking({{"If-Match", "W/\"abc\""}}), etag)) << "weak";
  EXPECT_EQ(NamedByIfNoneMatch(Asking({{"If-None-Match", "W/\"abc\""}}), etag), etag);
  EXPECT_TRUE(IfMatchHolds(Asking({}), etag));
  EXPECT_TRUE(IfMatchHolds(Asking({{"If-Match", "\"x\""}, {"If-Match", etag}}), etag));
}

TEST(Conditions, CutRanges) {
  Response whole = JsonOf(10);
  whole.body = "0123456789";
  whole.headers.emplace_back("Accept-Ranges", "bytes");
  const auto part = [&](const std::string& range) {
    return UnderConditions(Asking({{"Range", range}}), whole);
  };
  EXPECT_EQ(part("bytes=2-4").body, "234");
  EXPECT_EQ(part("bytes=2-4").status, 206);
  EXPECT_EQ(part("bytes=-3").body, "789");
  EXPECT_EQ(part("bytes=9-18446744073709551616").body, "9");
  EXPECT_EQ(part("bytes=-18446744073709551616").body, whole.body);
  for (const char* ignored : {"", "bytes", "bytes=", "bytes=-", "bytes=5-4", "bytes=1-2,4-5",
                              "bytes= 1-2", "bytes=+1-2", "bytes=1--2", "bytes=a-b", "lines=1-2"}) {
    EXPECT_EQ(part(ignored).status, 200) << ignored;
  }
  for (const char* outside :
       {"bytes=10-", "bytes=10-11", "bytes=-0", "bytes=99999999999999999999-"}) {
    EXPECT_EQ(ProblemOf([&] { part(outside); }).code, "range_not_satisfiable") << outside;
  }
  whole.body.clear();
  EXPECT_EQ(ProblemOf([&] { part("bytes=0-"); }).content_range, "bytes */0");
  EXPECT_EQ(ProblemOf([&] { part("bytes=-1"); }).status, 416);
}

TEST(Conditions, LeaveAloneWhatIsNoAnswerToAGet) {
  const Request request = Asking({{"If-None-Match", "*"}, {"If-Match", "\"y\""}});
  Response untagged = JsonOf(3);
  untagged.headers.clear();
  EXPECT_EQ(UnderConditions(request, untagged).status, 200);
  Response created = JsonOf(3);
  created.status = 201;
  EXPECT_EQ(UnderConditions(request, created).status, 201);
  EXPECT_THROW(UnderConditions(request, JsonOf(3)), ProblemError) << "If-Match comes first";
}

}  // namespace
}  // namespace pliant::server
