// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Compressed answers, and requests under conditions: ETags, parts, changes that may only happen to
// what the client has seen.
#include <atomic>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

using httplib::Headers;
using ::testing::EndsWith;
using ::testing::HasSubstr;

// After 304, which has no length, clients of cpp-httplib wait for the end of the connection.
const std::pair<const std::string, std::string> kClose = {"Connection", "close"};
constexpr const char* kImage = "/v1/collections/default/images/mug-1";

std::string CodeOf(const httplib::Result& answer) {
  return Json::parse(answer->body).value("code", "");
}

class ConditionsTest : public ServerTest {
 protected:
  void SetUp() override {
    Start({"--auto-train", "false"});
    auto client = server_->Client();
    ASSERT_EQ(client.Put(std::string(kImage) + "?object=mug", image_, "image/png")->status, 201);
  }
  std::string EtagOf(const std::string& path) {
    return server_->Client().Get(path)->get_header_value("ETag");
  }
  static std::string Of(const char* what) { return std::string(kImage) + what; }

  const std::string image_ = TestImage(1);
};

TEST_F(ConditionsTest, TextIsCompressedAsTheClientLikesIt) {
  auto client = server_->Client();
  client.set_decompress(false);
  auto reader = server_->Client();
  const std::string path = "/v1/openapi.json";
  // A client of cpp-httplib adds nothing to what it is told.
  const auto plain = client.Get(path, {{"Accept-Encoding", "identity"}});
  EXPECT_FALSE(plain->has_header("Content-Encoding"));
  const std::string etag = plain->get_header_value("ETag");
  const std::vector<std::pair<std::string, std::string>> chosen = {{"gzip", "gzip"},
                                                                   {"gzip, deflate, br", "gzip"},
                                                                   {"*", "gzip"},
                                                                   {"x-gzip", "gzip"},
                                                                   {"br;q=0.1, gzip;q=0.9", "gzip"},
                                                                   {"GZIP;Q=1.000", "gzip"},
                                                                   {"gzip;q=0, *", ""},
                                                                   {"br", ""},
                                                                   {"identity, gzip;q=0.5", ""},
                                                                   {"deflate", ""},
                                                                   {"", ""},
                                                                   {"gzip;q=x", ""},
                                                                   {"gzip;q=2", ""},
                                                                   {"gzip;q=0.0001", ""},
                                                                   {";;,,=", ""}};
  for (const auto& [accepted, coding] : chosen) {
    const auto answer = client.Get(path, {{"Accept-Encoding", accepted}});
    ASSERT_EQ(answer->status, 200) << accepted;
    EXPECT_EQ(answer->get_header_value("Content-Encoding"), coding) << accepted;
    EXPECT_EQ(answer->get_header_value("Vary"), "Accept-Encoding");
    EXPECT_EQ(answer->get_header_value("Content-Length"), std::to_string(answer->body.size()));
    if (coding.empty()) {
      EXPECT_EQ(answer->body, plain->body);
      EXPECT_EQ(answer->get_header_value("ETag"), etag);
      continue;
    }
    EXPECT_LT(answer->body.size(), plain->body.size() / 5);
    EXPECT_THAT(answer->get_header_value("ETag"), EndsWith("-" + coding + "\""));
    EXPECT_EQ(reader.Get(path, {{"Accept-Encoding", accepted}})->body, plain->body);
    const auto head = client.Head(path, {{"Accept-Encoding", accepted}});
    EXPECT_EQ(head->get_header_value("Content-Length"), std::to_string(answer->body.size()));
    const auto known = client.Get(path, {{"Accept-Encoding", accepted},
                                         {"If-None-Match", answer->get_header_value("ETag")},
                                         kClose});
    EXPECT_EQ(known->status, 304);
    EXPECT_EQ(known->get_header_value("ETag"), answer->get_header_value("ETag"));
  }
  for (const std::string& other :
       {Of("/content"), Of("/thumbnail"), std::string("/livez"), std::string(kImage)}) {
    const auto answer = client.Get(other, {{"Accept-Encoding", "br, gzip"}});
    EXPECT_FALSE(answer->has_header("Content-Encoding")) << other << ": an image, or short";
  }
  EXPECT_EQ(client.Get(Of("/content"), {{"Accept-Encoding", "gzip"}})->body, image_);
  EXPECT_EQ(client.Get(Of("/features"), {{"Accept-Encoding", "gzip"}})
                ->get_header_value("Content-Encoding"),
            "gzip");
}

// Long answers are compressed on some cores at most, and wait for nobody.
TEST_F(ConditionsTest, CompressingLongAnswersDoesNotKeepOthersWaiting) {
  auto client = server_->Client();
  const std::string large = TestImage(3, 0, 1600, 1200);
  ASSERT_EQ(client.Put("/v1/collections/default/images/large", large, "image/png")->status, 201);
  const std::string plain =
      client
          .Get("/v1/collections/default/images/large/features", {{"Accept-Encoding", "identity"}})
          ->body;
  std::atomic<bool> stop{false};
  std::atomic<int> compressed{0};
  std::vector<std::thread> readers;
  for (int i = 0; i < 8; ++i) {
    readers.emplace_back([&] {
      auto reader = server_->Client();
      while (!stop) {
        const auto answer = reader.Get("/v1/collections/default/images/large/features",
                                       {{"Accept-Encoding", "gzip"}});
        ASSERT_TRUE(answer);
        EXPECT_EQ(answer->body, plain);
        if (answer->has_header("Content-Encoding")) ++compressed;
      }
    });
  }
  for (int i = 0; i < 20; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    EXPECT_EQ(client.Get("/livez")->status, 200);
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(5));
  }
  const auto begin = std::chrono::steady_clock::now();
  while (compressed == 0 && std::chrono::steady_clock::now() - begin < std::chrono::seconds(30)) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  stop = true;
  for (std::thread& reader : readers) reader.join();
  EXPECT_GT(compressed, 0);
}

TEST_F(ConditionsTest, WhatTheClientHasIsNotSentAgain) {
  auto client = server_->Client();
  for (const std::string& path :
       {std::string(kImage), Of("/content"), Of("/thumbnail"), Of("/features"),
        std::string("/v1/openapi.json"), std::string("/v1/collections/default/objects/mug"),
        std::string("/")}) {
    SCOPED_TRACE(path);
    const Headers identity = {{"Accept-Encoding", "identity"}};
    const auto first = client.Get(path, identity);
    ASSERT_EQ(first->status, 200);
    const std::string etag = first->get_header_value("ETag");
    ASSERT_FALSE(etag.empty());
    for (const std::string& list :
         {etag, std::string("*"), "W/" + etag, "\"x\", " + etag, "\"a,b\" ,W/\"y\"," + etag}) {
      const auto same = client.Get(path, {{"If-None-Match", list}, kClose});
      EXPECT_EQ(same->status, 304) << list;
      EXPECT_EQ(same->body, "");
      EXPECT_EQ(same->get_header_value("ETag"), etag);
      EXPECT_FALSE(same->has_header("Content-Length"));
    }
    for (const std::string& list : {std::string("\"x\""), std::string("x"), std::string("\""),
                                    etag.substr(1), std::string("W/")}) {
      EXPECT_EQ(client.Get(path, {{"If-None-Match", list}, kClose})->status, 200) << list;
    }
    EXPECT_EQ(client.Get(path, {{"If-Match", etag}})->status, 200);
    EXPECT_EQ(client.Get(path, {{"If-Match", "*"}})->status, 200);
    for (const std::string& list : {std::string("\"x\""), "W/" + etag}) {
      const auto failed = client.Get(path, {{"If-Match", list}, {"If-None-Match", etag}});
      EXPECT_EQ(failed->status, 412) << list;
      EXPECT_EQ(CodeOf(failed), "precondition_failed");
    }
    EXPECT_EQ(client.Head(path, {{"If-None-Match", etag}, kClose})->status, 304);
  }
}

TEST_F(ConditionsTest, PartsOfAnImageCanBeAskedFor) {
  auto client = server_->Client();
  const std::string path = Of("/content");
  const std::size_t bytes = image_.size();
  const std::string total = std::to_string(bytes);
  const std::string etag = EtagOf(path);
  EXPECT_EQ(client.Get(path)->get_header_value("Accept-Ranges"), "bytes");
  const auto get = [&](const std::string& range, Headers more = {}) {
    more.emplace("Range", range);
    return client.Get(path, more);
  };
  const std::string last = std::to_string(bytes - 1);
  const std::vector<std::tuple<std::string, std::size_t, std::size_t>> parts = {
      {"bytes=0-0", 0, 0},
      {"bytes=10-99", 10, 99},
      {"bytes=" + last + "-", bytes - 1, bytes - 1},
      {"bytes=7-99999999", 7, bytes - 1},
      {"bytes=0-99999999999999999999", 0, bytes - 1},
      {"bytes=-99999999999999999999", 0, bytes - 1},
      {"bytes=-5", bytes - 5, bytes - 1},
      {"bytes=-99999999", 0, bytes - 1}};
  for (const auto& [range, from, to] : parts) {
    const auto part = get(range);
    ASSERT_EQ(part->status, 206) << range;
    EXPECT_EQ(part->body, image_.substr(from, to - from + 1)) << range;
    EXPECT_EQ(part->get_header_value("Content-Range"),
              "bytes " + std::to_string(from) + "-" + std::to_string(to) + "/" + total);
    EXPECT_EQ(part->get_header_value("ETag"), etag);
    EXPECT_EQ(part->get_header_value("Content-Type"), "image/png");
  }
  for (const char* odd : {"x", "lines=1-2", "bytes=5-1", "bytes=a-b"}) {
    EXPECT_EQ(get(odd)->status, 200) << odd;
    EXPECT_EQ(client.Head(path, {{"Range", odd}})->status, 200) << odd;
  }
  for (const std::string& range : {"bytes=" + total + "-", std::string("bytes=-0"),
                                   std::string("bytes=99999999999999999999-")}) {
    const auto outside = get(range);
    ASSERT_EQ(outside->status, 416) << range;
    EXPECT_EQ(CodeOf(outside), "range_not_satisfiable");
    EXPECT_EQ(outside->get_header_value("Content-Range"), "bytes */" + total);
  }
  EXPECT_EQ(get("bytes=0-1,3-4")->body, image_) << "several at once are not cut";
  EXPECT_EQ(get("bytes=0-9", {{"If-Range", etag}})->status, 206);
  for (const std::string& other :
       {std::string("\"x\""), "W/" + etag, std::string("Sun, 06 Nov 1994 08:49:37 GMT")}) {
    EXPECT_EQ(get("bytes=0-9", {{"If-Range", other}})->status, 200) << other;
  }
  EXPECT_EQ(get("bytes=0-9", {{"If-None-Match", etag}, kClose})->status, 304);
  EXPECT_EQ(get("bytes=0-9", {{"If-Match", "\"x\""}})->status, 412);
  EXPECT_EQ(client.Head(path, {{"Range", "bytes=0-9"}})->status, 200);
  EXPECT_EQ(client.Get(kImage, {{"Range", "bytes=0-9"}})->status, 200) << "no parts of records";
}

TEST_F(ConditionsTest, OnlyWhatTheClientHasSeenIsReplacedOrRemoved) {
  auto client = server_->Client();
  const std::string before = EtagOf(kImage);
  const std::string object = "/v1/collections/default/objects/mug";
  const std::string object_before = EtagOf(object);
  const auto put = [&](const std::string& path, const std::string& image, const Headers& headers) {
    return client.Put(path.c_str(), headers, image, "image/png");
  };
  const std::string other = TestImage(2);
  const std::string with_object = std::string(kImage) + "?object=mug";
  EXPECT_EQ(CodeOf(put(with_object, other, {{"If-Match", "\"x\""}})), "precondition_failed");
  EXPECT_EQ(CodeOf(put(with_object, image_, {{"If-Match", "\"x\""}})), "precondition_failed")
      << "also where nothing would have changed";
  EXPECT_EQ(CodeOf(put(with_object, other, {{"If-None-Match", "*"}})), "precondition_failed");
  EXPECT_EQ(client.Get(Of("/content"))->body, image_) << "nothing was changed";
  const auto replaced = put(with_object, other, {{"If-Match", before}});
  ASSERT_EQ(replaced->status, 200) << replaced->body;
  const std::string after = EtagOf(kImage);
  EXPECT_EQ(replaced->get_header_value("ETag"), after);
  EXPECT_NE(after, before);
  EXPECT_EQ(CodeOf(put(with_object, image_, {{"If-Match", before}})), "precondition_failed");

  const std::string fresh = "/v1/collections/default/images/new-1";
  EXPECT_EQ(CodeOf(put(fresh, image_, {{"If-Match", "*"}})), "precondition_failed");
  EXPECT_EQ(client.Get(fresh)->status, 404);
  EXPECT_EQ(put(fresh, image_, {{"If-None-Match", "*"}})->status, 201);
  EXPECT_EQ(CodeOf(put(fresh, image_, {{"If-None-Match", "*"}})), "precondition_failed");

  EXPECT_EQ(CodeOf(client.Delete(kImage, {{"If-Match", before}})), "precondition_failed");
  EXPECT_EQ(CodeOf(client.Delete(object, {{"If-Match", "\"x\""}})), "precondition_failed");
  EXPECT_EQ(client.Get(kImage)->status, 200);
  EXPECT_EQ(client.Delete(object, {{"If-Match", object_before}})->status, 200)
      << "it shows one image still, of the same id";
  EXPECT_EQ(CodeOf(client.Delete(kImage, {{"If-Match", after}})), "image_not_found");
  EXPECT_EQ(client.Delete(fresh, {{"If-Match", EtagOf(fresh)}})->status, 204);
  EXPECT_EQ(CodeOf(client.Delete(fresh, {{"If-Match", "*"}})), "image_not_found");
  EXPECT_EQ(CodeOf(client.Delete("/v1/collections/none", {{"If-Match", "*"}})),
            "precondition_failed")
      << "not understood there";
}

// Many at once with the same ETag: one of them wins.
TEST_F(ConditionsTest, OfManyChangesOfOneStateOneHappens) {
  const std::string etag = EtagOf(kImage);
  std::atomic<int> done{0};
  std::atomic<int> refused{0};
  std::vector<std::thread> clients;
  for (int i = 0; i < 8; ++i) {
    clients.emplace_back([&, i] {
      auto client = server_->Client();
      const auto answer =
          i % 2 == 0 ? client.Delete(kImage, {{"If-Match", etag}})
                     : client.Put(kImage, {{"If-Match", etag}}, TestImage(10 + i), "image/png");
      ASSERT_TRUE(answer);
      if (answer->status < 300) {
        ++done;
      } else {
        EXPECT_TRUE(answer->status == 412 || answer->status == 404) << answer->body;
        ++refused;
      }
    });
  }
  for (std::thread& client : clients) client.join();
  EXPECT_EQ(done, 1);
  EXPECT_EQ(refused, 7);
}

}  // namespace
}  // namespace pliant::testing
