// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Aliases of collections over HTTP, and collections' names for people.
#include <gtest/gtest.h>

#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

constexpr const char* kJson = "application/json";

class AliasesTest : public ServerTest {
 protected:
  void SetUp() override {
    Start({"--auto-train", "false"});
    auto client = server_->Client();
    for (const char* name : {"spring", "summer"}) {
      ASSERT_EQ(client.Put(std::string("/v1/collections/") + name)->status, 201);
    }
    ASSERT_EQ(Upload(client, TestImage(1), "coat", "spring")->status, 201);
    ASSERT_EQ(Upload(client, TestImage(2), "shirt", "summer")->status, 201);
  }
  httplib::Result Alias(const std::string& name, const std::string& collection) {
    return server_->Client().Put("/v1/aliases/" + name, Json{{"collection", collection}}.dump(),
                                 kJson);
  }
  Json Get(const std::string& path) { return Json::parse(server_->Client().Get(path)->body); }
};

TEST_F(AliasesTest, ShopSwitchesToItsNewCollection) {
  auto client = server_->Client();
  const auto made = Alias("live", "spring");
  EXPECT_EQ(made->status, 201);
  EXPECT_EQ(made->get_header_value("Location"), "/v1/aliases/live");
  EXPECT_EQ(Get("/v1/collections/live/objects")["objects"][0]["object"], "coat");
  const Json image = Get("/v1/collections/live/images")["images"][0];
  EXPECT_EQ(image["collection"], "spring") << "an image says where it is";

  const auto moved = Alias("live", "summer");
  EXPECT_EQ(moved->status, 200);
  EXPECT_EQ(Json::parse(moved->body)["collection"], "summer");
  EXPECT_EQ(Get("/v1/collections/live/objects")["objects"][0]["object"], "shirt");
  EXPECT_EQ(Upload(client, TestImage(3), "hat", "live")->status, 201);
  EXPECT_EQ(Get("/v1/collections/summer")["images"], 2);
  EXPECT_EQ(Get("/v1/collections/summer")["aliases"], Json::array({"live"}));

  const auto swapped = client.Patch("/v1/aliases", R"({"live": "spring", "before": "summer"})",
                                    "application/merge-patch+json");
  ASSERT_EQ(swapped->status, 200) << swapped->body;
  EXPECT_EQ(Json::parse(swapped->body)["aliases"].size(), 2u);
  EXPECT_EQ(client.Delete("/v1/aliases/before")->status, 204);
  EXPECT_EQ(client.Delete("/v1/aliases/before")->status, 404);
  EXPECT_EQ(Get("/v1/aliases/live")["collection"], "spring");
}

TEST_F(AliasesTest, CollectionIsNotDeletedByItsAlias) {
  auto client = server_->Client();
  ASSERT_EQ(Alias("live", "spring")->status, 201);
  const auto refused = client.Delete("/v1/collections/live");
  EXPECT_EQ(refused->status, 409);
  EXPECT_EQ(Json::parse(refused->body)["code"], "collection_is_alias");
  EXPECT_EQ(client.Put("/v1/collections/live")->status, 200) << "there is one";
  EXPECT_EQ(client.Delete("/v1/collections/spring")->status, 204);
  EXPECT_EQ(client.Get("/v1/collections/live/images")->status, 404);
  EXPECT_EQ(client.Get("/v1/aliases/live")->status, 404) << "aliases go with their collection";
}

TEST_F(AliasesTest, WhatIsWrongIsNamedAndChangesNothing) {
  auto client = server_->Client();
  const auto expect = [](const httplib::Result& answer, int status, const char* code) {
    EXPECT_EQ(answer->status, status) << answer->body;
    EXPECT_EQ(Json::parse(answer->body)["code"], code);
  };
  expect(Alias("summer", "spring"), 409, "collection_exists");
  expect(Alias("live", "winter"), 404, "collection_not_found");
  expect(Alias("l%20ve", "spring"), 400, "invalid_parameter");
  expect(client.Put("/v1/aliases/live", "{}", kJson), 400, "missing_parameter");
  expect(client.Put("/v1/aliases/live", R"({"collection": 3})", kJson), 400, "invalid_parameter");
  expect(client.Get("/v1/aliases/live"), 404, "alias_not_found");
  expect(client.Patch("/v1/aliases", R"({"live": "spring", "new": "winter"})", kJson), 404,
         "collection_not_found");
  expect(client.Patch("/v1/aliases", R"({"live": ["spring"]})", kJson), 400, "invalid_parameter");
  expect(client.Patch("/v1/aliases", "[]", kJson), 400, "invalid_json");
  EXPECT_EQ(Get("/v1/aliases")["aliases"], Json::array());
}

TEST_F(AliasesTest, AnErrorRepeatsLittleOfTheRequest) {
  auto client = server_->Client();
  std::string name;
  for (int i = 0; i < 300'000; ++i) name += "\u00e4";
  const std::string quoted = "\"" + name + "\"";
  const auto expect = [](const httplib::Result& answer, int status) {
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->status, status);
    EXPECT_LT(answer->body.size(), 4096U) << answer->body.substr(0, 200);
    EXPECT_FALSE(Json::parse(answer->body)["detail"].get<std::string>().empty());
  };
  expect(client.Patch("/v1/aliases", R"({"live": )" + quoted + "}", kJson), 404);
  expect(client.Patch("/v1/aliases", "{" + quoted + R"(: "spring"})", kJson), 400);
  expect(client.Patch("/v1/aliases", "{" + quoted + ": 3}", kJson), 400);
  expect(client.Patch("/v1/aliases", "{" + quoted + ": null}", kJson), 404);
  expect(client.Patch("/v1/collections/spring", "{" + quoted + ": 3}", kJson), 400);
  expect(client.Patch("/v1/collections/spring", R"({"display_name": )" + quoted + "}", kJson), 400);
  expect(client.Put("/v1/aliases/live", R"({"collection": )" + quoted + "}", kJson), 404);
  expect(client.Post("/v1/keys", R"({"scope": "read", "name": )" + quoted + "}", kJson), 400);
  expect(client.Post("/v1/keys", R"({"name": "a", "scope": )" + quoted + "}", kJson), 400);
  expect(client.Post("/v1/collections/spring/search", R"({"image_id": )" + quoted + "}", kJson),
         404);
  expect(client.Post("/v1/collections/spring/search", R"({"image_url": )" + quoted + "}", kJson),
         403);
}

TEST_F(AliasesTest, NamesForPeopleAreShownAndTakenBack) {
  auto client = server_->Client();
  const auto change = [&](const std::string& patch) {
    return client.Patch("/v1/collections/summer", patch, "application/merge-patch+json");
  };
  const auto named = change(R"({"display_name": "Summer shirts 2026!"})");
  ASSERT_EQ(named->status, 200) << named->body;
  EXPECT_EQ(Json::parse(named->body)["display_name"], "Summer shirts 2026!");
  const Json list = Get("/v1/collections");
  ASSERT_EQ(list["collections"].size(), 3U);
  EXPECT_EQ(list["collections"][2]["display_name"], "Summer shirts 2026!");
  EXPECT_EQ(change(R"({"name": "other"})")->status, 400);
  EXPECT_EQ(change(R"({"display_name": 7})")->status, 400);
  const auto long_name = change(Json{{"display_name", std::string(201, 'x')}}.dump());
  EXPECT_EQ(long_name->status, 400);
  EXPECT_EQ(Json::parse(long_name->body)["parameter"], "display_name");
  ASSERT_EQ(change(R"({"display_name": null})")->status, 200);
  EXPECT_TRUE(Get("/v1/collections/summer")["display_name"].is_null());
}

}  // namespace
}  // namespace pliant::testing
