// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Following a search result: where is that object in the next image?
#include <gtest/gtest.h>

#include "tests/integration/server_process.h"

namespace pliant::testing {
namespace {

TEST(ServerLocate, TellsWhereTheObjectIs) {
  const TemporaryFolder folder;
  // No vocabulary is needed.
  const ServerProcess server(folder / "test.db", {"--auto-train", "false"});
  auto client = server.Client();
  for (int object = 0; object < 3; ++object) {
    const auto added =
        client.Post("/v1/collections/default/images?object=thing%20" + std::to_string(object),
                    TestImage(static_cast<std::uint64_t>(object)), "image/png");
    ASSERT_TRUE(added && added->status == 201);
  }
  const std::string objects = "/v1/collections/default/objects/";
  const auto found = client.Post(objects + "thing%201/locate", TestImage(1, 1), "image/png");
  ASSERT_TRUE(found);
  ASSERT_EQ(found->status, 200) << found->body;
  const Json json = Json::parse(found->body);
  EXPECT_EQ(json["object"], "thing 1");
  EXPECT_EQ(json["found"], true) << found->body;
  EXPECT_TRUE(json["reason"].is_null());
  EXPECT_GE(json["inliers"], 8);
  EXPECT_GE(json["matches"], json["inliers"]);
  EXPECT_GE(json["outline"].size(), 3U);
  EXPECT_EQ(json["mesh"]["points"].size(),
            json["mesh"]["columns"].get<std::size_t>() * json["mesh"]["rows"].get<std::size_t>());
  EXPECT_EQ(json["width"], 320);
  EXPECT_EQ(json["compared"], 1);

  const auto form = client.Post(
      objects + "thing%201/locate",
      httplib::MultipartFormDataItems{{"image", TestImage(2, 1), "photo.png", "image/png"}});
  ASSERT_EQ(form->status, 200) << form->body;
  EXPECT_EQ(Json::parse(form->body)["found"], false);
  EXPECT_TRUE(Json::parse(form->body)["reason"].is_string());
  EXPECT_TRUE(Json::parse(form->body)["mesh"].is_null());

  const auto code = [](const httplib::Result& result) {
    return Json::parse(result->body)["code"].get<std::string>();
  };
  const auto unknown = client.Post(objects + "hat/locate", TestImage(1), "image/png");
  EXPECT_EQ(unknown->status, 404);
  EXPECT_EQ(code(unknown), "object_not_found");
  const auto nowhere =
      client.Post("/v1/collections/nowhere/objects/hat/locate", TestImage(1), "image/png");
  EXPECT_EQ(code(nowhere), "collection_not_found");
  const auto broken = client.Post(objects + "thing%201/locate", "no image", "image/png");
  EXPECT_EQ(broken->status, 415) << broken->body;
  EXPECT_EQ(client.Post(objects + "thing%201/locate?limit=3", TestImage(1), "image/png")->status,
            400);
  EXPECT_EQ(client.Get(objects + "thing%201/locate")->status, 405);
}

}  // namespace
}  // namespace pliant::testing
