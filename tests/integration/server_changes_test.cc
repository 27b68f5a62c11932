// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// PATCH: images and objects changed in place by JSON merge patches.
#include <csignal>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>

#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;

constexpr const char* kPatchType = "application/merge-patch+json";
constexpr const char* kObjects = "/v1/collections/default/objects";

std::string MakeImage(const std::string& id) { return std::string(kImages) + "/" + id; }
std::string Object(const std::string& name) { return std::string(kObjects) + "/" + name; }

class ChangesTest : public ServerTest {
 protected:
  void SetUp() override {
    Start({"--auto-train", "false"});
    client_ = std::make_unique<httplib::Client>(server_->Client());
    for (const auto& [id, object] : {std::pair{"a", "mug"}, {"b", "mug"}, {"c", "cup"}}) {
      const auto answer = client_->Put(
          MakeImage(id) + "?object=" + object + R"(&metadata={"shelf":4,"colour":"red"})",
          TestImage(static_cast<std::uint64_t>(id[0])), "image/png");
      ASSERT_TRUE(answer && answer->status == 201) << (answer ? answer->body : "no answer");
    }
  }

  httplib::Result Patch(const std::string& path, const std::string& body,
                        const std::string& type = kPatchType, const std::string& if_match = "") {
    httplib::Headers headers;
    if (!if_match.empty()) headers.emplace("If-Match", if_match);
    return client_->Patch(path, headers, body, type);
  }
  Json Changed(const std::string& path, const std::string& body) {
    const auto answer = Patch(path, body);
    EXPECT_TRUE(answer && answer->status == 200) << (answer ? answer->body : "no answer");
    return answer ? Json::parse(answer->body) : Json::object();
  }
  void ExpectProblem(const httplib::Result& answer, int status, const std::string& code,
                     const std::string& parameter = "") {
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->status, status) << answer->body;
    const Json problem = Json::parse(answer->body);
    EXPECT_EQ(problem["code"], code) << answer->body;
    EXPECT_EQ(problem.value("parameter", ""), parameter) << answer->body;
  }
  Json Read(const std::string& path) { return Json::parse(client_->Get(path)->body); }

  std::unique_ptr<httplib::Client> client_;
};

TEST_F(ChangesTest, AnImageIsChangedAsAMergePatchSays) {
  Json before = Read(MakeImage("a"));
  Json now =
      Changed(MakeImage("a"), R"({"metadata": {"shelf": 5, "colour": null, "x": {"y": 1}}})");
  EXPECT_GT(now["updated_at"], before["updated_at"]);
  before["updated_at"] = now["updated_at"];
  before["metadata"] = {{"shelf", 5}, {"x", {{"y", 1}}}};
  EXPECT_EQ(now, before) << "nothing else changes";
  now = Changed(MakeImage("a"), R"({"object": "bowl", "source": "bowl.png", "metadata": null})");
  EXPECT_EQ(now["object"], "bowl");
  EXPECT_EQ(now["source"], "bowl.png");
  EXPECT_EQ(now["metadata"], Json::object());
  EXPECT_EQ(now, Read(MakeImage("a")));
  EXPECT_EQ(Read(Object("mug"))["images"], 1);
  EXPECT_EQ(Changed(MakeImage("a"), R"({"object": null})")["object"], "");
  EXPECT_EQ(client_->Get(Object("bowl"))->status, 404) << "no image is left of it";
  EXPECT_EQ(Changed(MakeImage("a"), "{}"), Read(MakeImage("a"))) << "no change is no fault";
  EXPECT_EQ(Patch(MakeImage("a"), R"({"object":"x"})", "application/json")->status, 200);
}

TEST_F(ChangesTest, WhatIsWrongIsNamedAndChangesNothing) {
  const Json before = Read(MakeImage("a"));
  const std::string a = MakeImage("a");
  ExpectProblem(Patch(a, R"({"object": 5})"), 400, "invalid_parameter", "object");
  ExpectProblem(Patch(a, R"({"object": ["x"]})"), 400, "invalid_parameter", "object");
  ExpectProblem(Patch(a, R"({"object": "a\u0000b"})"), 400, "invalid_parameter", "object");
  ExpectProblem(Patch(a, R"({"metadata": []})"), 400, "invalid_parameter", "metadata");
  ExpectProblem(Patch(a, R"({"metadata": "{}"})"), 400, "invalid_parameter", "metadata");
  ExpectProblem(Patch(a, R"({"source": true})"), 400, "invalid_parameter", "source");
  ExpectProblem(Patch(a, R"({"object": "x", "width": 5})"), 400, "unknown_parameter", "width");
  ExpectProblem(Patch(a, "{"), 400, "invalid_json", "body");
  ExpectProblem(Patch(a, "[]"), 400, "invalid_json", "body");
  ExpectProblem(Patch(a, "", kPatchType), 400, "missing_parameter", "body");
  ExpectProblem(Patch(a, "{}", "application/json-patch+json"), 415, "unsupported_content_type");
  ExpectProblem(Patch(a + "?object=x", "{}"), 400, "unknown_parameter", "object");
  ExpectProblem(Patch(a, R"({"metadata": {"x": ")" + std::string(70'000, 'x') + R"("}})"), 400,
                "invalid_parameter", "metadata");
  ExpectProblem(Patch(MakeImage("nobody"), R"({"object": "x"})"), 404, "image_not_found");
  ExpectProblem(Patch("/v1/collections/none/images/a", "{}"), 404, "collection_not_found");
  EXPECT_EQ(Read(a), before);
  const std::string mug = Object("mug");
  EXPECT_EQ(Patch(mug, "{}")->status, 200) << "changes nothing, as that of an image";
  for (const char* name : {"null", "7", R"("")"}) {
    ExpectProblem(Patch(mug, R"({"object": )" + std::string(name) + "}"), 400, "invalid_parameter",
                  "object");
  }
  ExpectProblem(Patch(mug, R"({"object": "x", "images": 1})"), 400, "unknown_parameter", "images");
  ExpectProblem(Patch(Object("none"), R"({"object": "x"})"), 404, "object_not_found");
  ExpectProblem(Patch(mug + "?merge=maybe", R"({"object": "x"})"), 400, "invalid_parameter",
                "merge");
  EXPECT_EQ(Read(mug)["images"], 2);
}

TEST_F(ChangesTest, IfMatchIsHonoured) {
  const auto read = client_->Get(MakeImage("a"));
  const std::string etag = read->get_header_value("ETag");
  ASSERT_THAT(etag, ::testing::MatchesRegex("\"[0-9a-f]{32}\"")) << "strong";
  ExpectProblem(Patch(MakeImage("a"), R"({"object": "x"})", kPatchType, "\"other\""), 412,
                "precondition_failed");
  ExpectProblem(Patch(MakeImage("a"), R"({"object": "x"})", kPatchType, "W/" + etag), 412,
                "precondition_failed");
  EXPECT_EQ(Read(MakeImage("a"))["object"], "mug");
  const auto changed = Patch(MakeImage("a"), R"({"object": "x"})", kPatchType, "\"no\", " + etag);
  EXPECT_EQ(changed->status, 200) << changed->body;
  EXPECT_EQ(changed->get_header_value("ETag"),
            client_->Get(MakeImage("a"))->get_header_value("ETag"));
  ExpectProblem(Patch(MakeImage("a"), R"({"object": "y"})", kPatchType, etag), 412,
                "precondition_failed");
  EXPECT_EQ(Patch(MakeImage("a"), R"({"object": "mug"})", kPatchType, "*")->status, 200);
  const httplib::Headers other = {{"If-Match", "\"other\""}};
  ExpectProblem(client_->Delete(MakeImage("a"), other), 412, "precondition_failed");
  ExpectProblem(client_->Put(MakeImage("a"), other, TestImage(9), "image/png"), 412,
                "precondition_failed");
  EXPECT_EQ(Read(MakeImage("a"))["object"], "mug") << "it is there, and the image it was";

  const std::string object = client_->Get(Object("mug"))->get_header_value("ETag");
  client_->Delete(MakeImage("b"));
  ExpectProblem(Patch(Object("mug"), R"({"object": "x"})", kPatchType, object), 412,
                "precondition_failed");
  const std::string now = client_->Get(Object("mug"))->get_header_value("ETag");
  const auto renamed = Patch(Object("mug"), R"({"object": "x"})", kPatchType, now);
  EXPECT_EQ(renamed->status, 200) << renamed->body;
  EXPECT_EQ(renamed->get_header_value("ETag"), client_->Get(Object("x"))->get_header_value("ETag"));
}

TEST_F(ChangesTest, AnObjectIsRenamedOrJoinsAnother) {
  EXPECT_EQ(Changed(Object("mug"), R"({"object": "tea mug"})"),
            (Json{{"object", "tea mug"}, {"images", 2}, {"image_id", "a"}}));
  EXPECT_EQ(client_->Get(Object("mug"))->status, 404);
  EXPECT_EQ(Read(MakeImage("b"))["object"], "tea mug");
  const auto taken = Patch(Object("cup"), R"({"object": "tea mug"})");
  ExpectProblem(taken, 409, "object_exists");
  EXPECT_THAT(taken->body, HasSubstr("with 2 images"));
  EXPECT_EQ(Changed(Object("cup") + "?merge=true", R"({"object": "tea mug"})")["images"], 3);
  EXPECT_EQ(client_->Get(Object("cup"))->status, 404);
  EXPECT_EQ(Read(MakeImage("c"))["object"], "tea mug");
}

TEST_F(ChangesTest, ImagesAndObjectsMoveToAnotherCollection) {
  ASSERT_EQ(client_->Put("/v1/collections/winter")->status, 201);
  const Json moved =
      Changed(MakeImage("c"), R"({"collection": "winter", "metadata": {"shelf": 5}})");
  EXPECT_EQ(moved["collection"], "winter");
  EXPECT_EQ(moved["object"], "cup");
  EXPECT_EQ(client_->Get(MakeImage("c"))->status, 404);
  EXPECT_EQ(client_->Get("/v1/collections/winter/images/c/content")->body, TestImage('c'));
  EXPECT_EQ(Changed(Object("mug"), R"({"collection": "winter"})"),
            (Json{{"object", "mug"}, {"images", 2}, {"image_id", "a"}}));
  EXPECT_EQ(client_->Get(Object("mug"))->status, 404);
  ASSERT_EQ(client_->Put(MakeImage("a"), TestImage(7), "image/png")->status, 201);
  ExpectProblem(Patch(MakeImage("a"), R"({"collection": "winter"})"), 409, "image_exists");
  ExpectProblem(Patch(MakeImage("a"), R"({"collection": "x"})"), 404, "collection_not_found");
  EXPECT_EQ(client_->Get(MakeImage("a"))->status, 200) << "nothing was moved";
}

TEST_F(ChangesTest, TheSameBytesByAnotherNameSayWhichImageToChange) {
  const auto refused = Upload(*client_, TestImage('a'), "bowl");
  ExpectProblem(refused, 409, "same_bytes");
  const Json problem = Json::parse(refused->body);
  EXPECT_EQ(problem["image_id"], "a");
  EXPECT_EQ(problem["object"], "mug");
  Changed(MakeImage(problem["image_id"]), R"({"object": "bowl"})");
  EXPECT_EQ(Upload(*client_, TestImage('a'), "bowl")->status, 200);
}

TEST_F(ChangesTest, AKillLosesNothingThatWasAnsweredAndOtherServersSeeIt) {
  client_->Post("/v1/collections/default/vocabularies", R"({"words": 20})", "application/json");
  while (Read("/v1/jobs")["jobs"][0]["finished_at"].is_null()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  const ServerProcess other(folder_.path() / "test.db", {"--auto-train", "false"});
  auto client = other.Client();
  EXPECT_EQ(SearchFor(client, TestImage('a'))["hits"][0]["object"], "mug");
  Changed(Object("mug"), R"({"object": "tea mug"})");
  EXPECT_EQ(SearchFor(client, TestImage('a'))["hits"][0]["object"], "tea mug");
  Changed(MakeImage("a"), R"({"object": "cup", "metadata": {"shelf": 9}})");
  const Json hit = SearchFor(client, TestImage('a'))["hits"][0];
  EXPECT_EQ(hit["object"], "cup");
  EXPECT_EQ(hit["metadata"]["shelf"], 9);
  server_->Signal(SIGKILL);
  server_->Wait();
  Start({"--auto-train", "false"});
  client_ = std::make_unique<httplib::Client>(server_->Client());
  EXPECT_EQ(Read(MakeImage("a"))["object"], "cup");
  EXPECT_EQ(SearchFor(*client_, TestImage('a'))["hits"][0]["object"], "cup");
}

TEST_F(ChangesTest, ChangesAndDeletionsAtOnceLeaveNoHalves) {
  std::vector<std::jthread> threads;
  for (int t = 0; t < 3; ++t) {
    threads.emplace_back([this, t] {
      auto client = server_->Client();
      for (int i = 0; i < 20; ++i) {
        const auto answer = client.Patch(
            MakeImage("a"), R"({"object": "o)" + std::to_string((i + t) % 3) + "\"}", kPatchType);
        ASSERT_TRUE(answer);
        EXPECT_TRUE(answer->status == 200 || answer->status == 404) << answer->body;
      }
    });
  }
  threads.emplace_back([this] {
    auto client = server_->Client();
    for (int i = 0; i < 10; ++i) {
      client.Delete(MakeImage("a"));
      client.Put(MakeImage("a"), TestImage('a'), "image/png");
    }
  });
  threads.clear();
  EXPECT_EQ(Read("/v1/collections/default")["images"], 3);
  EXPECT_EQ(Read(std::string(kImages) + "?limit=10")["images"].size(), 3u);
  ASSERT_EQ(server_->Stop(), 0);
  const ProgramResult check =
      RunProgram({"db", "check", "--db", DatabaseOf(folder_.path() / "test.db"), "--json"});
  EXPECT_EQ(check.status, 0) << check.out << check.err;
}

TEST_F(ChangesTest, AnAllowedOriginMayPatch) {
  ASSERT_EQ(server_->Stop(), 0);
  Start({"--cors-origins", "https://shop.example"});
  auto client = server_->Client();
  const auto preflight = client.Options(
      MakeImage("a"),
      {{"Origin", "https://shop.example"}, {"Access-Control-Request-Method", "PATCH"}});
  ASSERT_TRUE(preflight);
  EXPECT_EQ(preflight->status, 204);
  EXPECT_THAT(preflight->get_header_value("Access-Control-Allow-Methods"), HasSubstr("PATCH"));
  for (const char* header : {"If-Match", "Idempotency-Key", "If-Range, Range"}) {
    EXPECT_THAT(preflight->get_header_value("Access-Control-Allow-Headers"), HasSubstr(header));
  }
  for (const char* header : {"Content-Range", "Idempotency-Replayed"}) {
    EXPECT_THAT(preflight->get_header_value("Access-Control-Expose-Headers"), HasSubstr(header));
  }
  const auto elsewhere = client.Patch(MakeImage("a"), {{"Origin", "https://other.example"}},
                                      R"({"object": "x"})", kPatchType);
  ExpectProblem(elsewhere, 403, "cross_site");
}

}  // namespace
}  // namespace pliant::testing
