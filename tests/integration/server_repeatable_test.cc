// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Idempotency-Key: what is sent again is not done again, by this server or the next.
#include <atomic>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

using httplib::Headers;

constexpr const char* kTrain = "/v1/collections/default/vocabularies";

class RepeatableTest : public ServerTest {
 protected:
  void SetUp() override { Start({"--auto-train", "false"}); }

  static Headers Key(const std::string& key) { return {{"Idempotency-Key", key}}; }
  static std::string CodeOf(const httplib::Result& answer) {
    return Json::parse(answer->body).value("code", "");
  }
  httplib::Result Add(httplib::Client& client, const std::string& key, const std::string& image,
                      const std::string& object) {
    return client.Post(kImages, Key(key),
                       httplib::MultipartFormDataItems{{"image", image, "photo.png", "image/png"},
                                                       {"object", object, "", ""}});
  }
  std::string CreateKey(const std::string& name) {
    const ProgramResult made = Program({"keys", "create", "--name", name, "--scope", "write",
                                        "--db", DatabaseOf(folder_.path() / "test.db")},
                                       {}, ServerPath())
                                   .Wait();
    EXPECT_EQ(made.status, 0) << made.err;
    return made.out.substr(0, made.out.find('\n'));
  }
  std::size_t Jobs() { return Json::parse(server_->Client().Get("/v1/jobs")->body)["jobs"].size(); }
};

TEST_F(RepeatableTest, SentAgainItIsAnsweredAsBeforeAndNotDone) {
  auto client = server_->Client();
  const auto first = Add(client, "one", TestImage(1), "mug");
  ASSERT_EQ(first->status, 201) << first->body;
  EXPECT_FALSE(first->has_header("Idempotency-Replayed"));
  const std::string id = Json::parse(first->body)["id"];
  // The image is gone, and stays so: the request was done once. Boundaries of forms differ.
  ASSERT_EQ(client.Delete(std::string(kImages) + "/" + id)->status, 204);
  const auto again = Add(client, "one", TestImage(1), "mug");
  EXPECT_EQ(again->status, 201);
  EXPECT_EQ(again->body, first->body);
  EXPECT_EQ(again->get_header_value("Location"), first->get_header_value("Location"));
  EXPECT_EQ(again->get_header_value("Idempotency-Replayed"), "true");
  EXPECT_EQ(client.Get(std::string(kImages) + "/" + id)->status, 404);
  EXPECT_EQ(Add(client, "two", TestImage(1), "mug")->status, 201) << "another request";
}

TEST_F(RepeatableTest, KeyIsGoodForOneRequest) {
  auto client = server_->Client();
  ASSERT_EQ(Add(client, "one", TestImage(1), "mug")->status, 201);
  for (const auto& other :
       {Add(client, "one", TestImage(2), "mug"), Add(client, "one", TestImage(1), "cup"),
        client.Post(kTrain, Key("one"), "{}", "application/json")}) {
    EXPECT_EQ(other->status, 422);
    EXPECT_EQ(CodeOf(other), "idempotency_other");
  }
  EXPECT_EQ(Jobs(), 0u);
}

TEST_F(RepeatableTest, WhatFailedIsDoneAnew) {
  auto client = server_->Client();
  ASSERT_EQ(
      client.Put("/v1/collections/default/images/a?object=mug", TestImage(1), "image/png")->status,
      201);
  const std::string path = "/v1/collections/default/objects/cup";
  const auto rename = [&] {
    return client.Patch(path, Key("r"), R"({"object": "glass"})", "application/json");
  };
  EXPECT_EQ(rename()->status, 404);
  ASSERT_EQ(
      client.Put("/v1/collections/default/images/b?object=cup", TestImage(2), "image/png")->status,
      201);
  EXPECT_EQ(rename()->status, 200);
  EXPECT_EQ(rename()->get_header_value("Idempotency-Replayed"), "true");
}

TEST_F(RepeatableTest, ServerThatFollowsKnowsWhatWasAnswered) {
  std::string job;
  {
    auto client = server_->Client();
    for (int i = 0; i < 4; ++i) Upload(client, TestImage(i), "o" + std::to_string(i));
    const auto begun = client.Post(kTrain, Key("train"), R"({"words": 20})", "application/json");
    ASSERT_EQ(begun->status, 202) << begun->body;
    job = Json::parse(begun->body)["id"];
  }
  server_->Signal(SIGKILL);
  server_->Wait();
  Start({"--auto-train", "false"});
  auto client = server_->Client();
  const auto again = client.Post(kTrain, Key("train"), R"({"words": 20})", "application/json");
  EXPECT_EQ(again->status, 202);
  EXPECT_EQ(Json::parse(again->body)["id"], job);
  EXPECT_EQ(Jobs(), 1u);
}

TEST_F(RepeatableTest, AnotherServerOnTheDatabaseKnowsWhatWasAnswered) {
  const ServerProcess second(folder_.path() / "test.db", {"--auto-train", "false"});
  auto client = server_->Client();
  auto other = second.Client();
  const auto first = Add(client, "one", TestImage(1), "mug");
  ASSERT_EQ(first->status, 201) << first->body;
  const auto again = Add(other, "one", TestImage(1), "mug");
  EXPECT_EQ(again->status, 201);
  EXPECT_EQ(again->body, first->body);
  EXPECT_EQ(again->get_header_value("Idempotency-Replayed"), "true");
  EXPECT_EQ(Add(other, "one", TestImage(1), "cup")->status, 422);
}

TEST_F(RepeatableTest, OfManyAtOnceOneIsDone) {
  {
    auto client = server_->Client();
    for (int i = 0; i < 4; ++i) Upload(client, TestImage(i), "o" + std::to_string(i));
  }
  std::atomic<int> accepted{0};
  std::atomic<int> waiting{0};
  std::atomic<int> other{0};
  std::vector<std::thread> clients;
  for (int i = 0; i < 8; ++i) {
    clients.emplace_back([&] {
      auto client = server_->Client();
      const auto answer = client.Post(kTrain, Key("k"), R"({"words": 20})", "application/json");
      if (answer && answer->status == 202)
        ++accepted;
      else if (answer && answer->status == 409 && CodeOf(answer) == "idempotency_running" &&
               answer->has_header("Retry-After"))
        ++waiting;
      else
        ++other;
    });
  }
  for (std::thread& client : clients) client.join();
  EXPECT_GE(accepted, 1);
  EXPECT_EQ(accepted + waiting, 8);
  EXPECT_EQ(other, 0);
  EXPECT_EQ(Jobs(), 1u);
}

TEST_F(RepeatableTest, KeysOfDifferentCallersAreDifferent) {
  const std::string one = CreateKey("one");
  const std::string two = CreateKey("two");
  auto client = server_->Client();
  const auto add = [&](const std::string& key, int image) {
    return client.Post(kImages, {{"Authorization", "Bearer " + key}, {"Idempotency-Key", "k"}},
                       TestImage(image), "image/png");
  };
  EXPECT_EQ(add(one, 1)->status, 201);
  EXPECT_EQ(add(two, 2)->status, 201);
  EXPECT_EQ(add(one, 2)->status, 422);
}

TEST_F(RepeatableTest, KeyThatIsNoneIsRefusedAndWhereItMeansNothingItIsIgnored) {
  auto client = server_->Client();
  for (const std::string& bad :
       {std::string(256, 'x'), std::string("a b"), std::string("\xc3\xa9")}) {
    const auto answer = client.Post(kImages, Key(bad), TestImage(1), "image/png");
    EXPECT_EQ(answer->status, 400) << bad;
    EXPECT_EQ(Json::parse(answer->body)["parameter"], "Idempotency-Key");
  }
  const auto twice = client.Post(kImages, {{"Idempotency-Key", "a"}, {"Idempotency-Key", "b"}},
                                 TestImage(1), "image/png");
  EXPECT_EQ(twice->status, 400);
  EXPECT_EQ(client.Get("/v1/collections", Key("a"))->status, 200);
  EXPECT_EQ(client.Put("/v1/collections/x", Key("a"), "", "application/json")->status, 201);
  EXPECT_EQ(client.Put("/v1/collections/y", Key("a"), "", "application/json")->status, 201);
}

}  // namespace
}  // namespace pliant::testing
