// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The main job over HTTP: upload, search, list, delete, restart; page, health, log.
#include <regex>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

TEST_F(ServerTest, UploadSearchDeleteRestart) {
  Start();
  auto client = server_->Client();
  constexpr int kObjects = 6;
  std::vector<std::string> ids;
  for (int object = 0; object < kObjects; ++object) {
    const auto answer = Upload(client, TestImage(object), "thing " + std::to_string(object));
    ASSERT_TRUE(answer);
    ASSERT_EQ(answer->status, 201) << answer->body;
    const Json image = Json::parse(answer->body);
    EXPECT_EQ(image["object"], "thing " + std::to_string(object));
    EXPECT_EQ(image["source"], "photo.png");
    EXPECT_EQ(image["media_type"], "image/png");
    EXPECT_EQ(image["width"], 320);
    ids.push_back(image["id"]);
    EXPECT_EQ(answer->get_header_value("Location"),
              std::string(kImages) + "/" + image["id"].get<std::string>());
  }
  // Nobody trained a vocabulary; the first search waits for the automatic one.
  for (int object = 0; object < kObjects; ++object) {
    const Json found = SearchFor(client, TestImage(object, 1));
    ASSERT_FALSE(found["hits"].empty());
    EXPECT_EQ(found["hits"][0]["object"], "thing " + std::to_string(object)) << found;
    EXPECT_EQ(found["hits"][0]["rank"], 1);
    EXPECT_GT(found["hits"][0]["score"], 0);
    EXPECT_LE(found["hits"][0]["score"], 1);
  }
  // A stored image finds itself, where it is not left out.
  const auto by_id =
      client.Post(kSearch, Json{{"image_id", ids[2]}, {"limit", 2}, {"exclude_self", false}}.dump(),
                  "application/json");
  ASSERT_EQ(by_id->status, 200) << by_id->body;
  EXPECT_EQ(Json::parse(by_id->body)["hits"][0]["image_id"], ids[2]);

  ASSERT_EQ(client.Delete(kImages + ("/" + ids[3]))->status, 204);
  EXPECT_EQ(client.Get(kImages + ("/" + ids[3]))->status, 404);
  EXPECT_EQ(client.Delete(kImages + ("/" + ids[3]))->status, 404);
  const auto gone = ::testing::Not(::testing::Contains(ids[3]));
  EXPECT_THAT(ImageIds(SearchFor(client, TestImage(3, 1), "?limit=100")["hits"]), gone);

  EXPECT_EQ(server_->Stop(), 0) << server_->Log();
  Start();
  auto again = server_->Client();
  EXPECT_EQ(again.Get(kImages + ("/" + ids[3]))->status, 404);
  EXPECT_THAT(ImageIds(SearchFor(again, TestImage(3, 1), "?limit=100")["hits"]), gone);
  EXPECT_EQ(SearchFor(again, TestImage(4, 1))["hits"][0]["object"], "thing 4");
}

TEST_F(ServerTest, SameBytesTwiceIsNoWorkTwice) {
  Start({"--auto-train", "false"});
  auto client = server_->Client();
  const std::string image = TestImage(1);
  const auto first = Upload(client, image, "cup");
  const auto second = Upload(client, image, "cup");
  ASSERT_EQ(first->status, 201);
  EXPECT_EQ(second->status, 200);
  EXPECT_EQ(first->body, second->body);
  EXPECT_EQ(second->get_header_value("Content-Location"), first->get_header_value("Location"));

  const std::string path = std::string(kImages) + "/mine?object=cup";
  const auto created = client.Put(path, image, "image/png");
  const auto same = client.Put(path, image, "image/png");
  EXPECT_EQ(created->status, 201) << created->body;
  EXPECT_EQ(same->status, 200);
  EXPECT_EQ(created->body, same->body);  // added_at too: nothing was written
  const auto replaced = client.Put(path, TestImage(2), "image/png");
  EXPECT_EQ(replaced->status, 200);
  EXPECT_NE(Json::parse(replaced->body)["sha256"], Json::parse(created->body)["sha256"]);
  EXPECT_EQ(Json::parse(client.Get("/v1/collections/default")->body)["images"], 2);
}

TEST_F(ServerTest, KeepsContentMetadataThumbnailAndFeatures) {
  Start({"--auto-train", "false"});
  auto client = server_->Client();
  const std::string image = TestImage(5);
  const auto created = client.Post(
      kImages, httplib::MultipartFormDataItems{{"image", image, "../../etc/a b.png", "image/png"},
                                               {"id", "shelf:4", "", ""},
                                               {"metadata", R"({"shelf": 4})", "", ""}});
  ASSERT_EQ(created->status, 201) << created->body;
  const Json record = Json::parse(created->body);
  EXPECT_EQ(record["metadata"]["shelf"], 4);
  EXPECT_EQ(record["source"], "a b.png");
  const std::string path = created->get_header_value("Location");
  // cpp-httplib 0.11 decodes the values of headers, 0.18 leaves this one as it was sent.
  EXPECT_THAT(path, ::testing::AnyOf(std::string(kImages) + "/shelf:4",
                                     std::string(kImages) + "/shelf%3A4"));
  const std::string sent = server_->Talk("PUT " + std::string(kImages) +
                                         "/shelf%3A5 HTTP/1.1\r\nHost: localhost\r\nConnection: "
                                         "close\r\nContent-Type: image/png\r\nContent-Length: " +
                                         std::to_string(image.size()) + "\r\n\r\n" + image);
  EXPECT_THAT(sent, ::testing::StartsWith("HTTP/1.1 201 "));
  EXPECT_THAT(sent,
              ::testing::HasSubstr("\r\nLocation: " + std::string(kImages) + "/shelf%3A5\r\n"));

  const auto content = client.Get(path + "/content");
  EXPECT_EQ(content->body, image);
  EXPECT_EQ(content->get_header_value("Content-Type"), "image/png");
  EXPECT_EQ(content->get_header_value("X-Content-Type-Options"), "nosniff");
  // By hand: the client library waits for a body of a 304, which has none.
  const std::string unchanged = server_->Talk(
      "GET " + path + "/content HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n" +
      "If-None-Match: " + content->get_header_value("ETag") + "\r\n\r\n");
  EXPECT_THAT(unchanged, ::testing::StartsWith("HTTP/1.1 304 "));
  EXPECT_THAT(unchanged, ::testing::EndsWith("\r\n\r\n"));
  EXPECT_THAT(unchanged, ::testing::Not(::testing::HasSubstr("Content-Length")));
  const auto head = client.Head(path + "/content");
  EXPECT_EQ(head->status, 200);
  EXPECT_EQ(head->get_header_value("Content-Length"), std::to_string(image.size()));

  const auto thumbnail = client.Get(path + "/thumbnail");
  EXPECT_EQ(thumbnail->get_header_value("Content-Type"), "image/jpeg");
  EXPECT_EQ(thumbnail->body.substr(0, 2), "\xff\xd8");
  EXPECT_EQ(client.Get(path + "/thumbnail")->body, thumbnail->body);

  const Json features = Json::parse(client.Get(path + "/features")->body);
  EXPECT_EQ(features["model_id"], "rootsift:1");
  EXPECT_EQ(features["keypoints"].size(), record["keypoints"]);
  EXPECT_EQ(features["descriptors"]["rows"], record["keypoints"]);
  EXPECT_EQ(features["descriptors"]["dim"], 128);
  const auto rows = features["descriptors"]["rows"].get<std::size_t>();
  EXPECT_EQ(features["descriptors"]["base64"].get<std::string>().size(),
            (rows * 128 * 4 + 2) / 3 * 4);
}

TEST_F(ServerTest, ListsByCursorAndByObject) {
  Start({"--auto-train", "false"});
  auto client = server_->Client();
  std::set<std::string> uploaded;
  for (int i = 0; i < 7; ++i) {
    const auto answer = Upload(client, TestImage(i), i % 2 == 0 ? "even ü/1" : "odd");
    uploaded.insert(Json::parse(answer->body)["id"]);
  }
  std::set<std::string> listed;
  std::string cursor;
  do {
    const auto answer = client.Get(std::string(kImages) + "?limit=3&cursor=" + cursor);
    ASSERT_EQ(answer->status, 200) << answer->body;
    const Json page = Json::parse(answer->body);
    EXPECT_LE(page["images"].size(), 3U);
    for (const Json& image : page["images"]) EXPECT_TRUE(listed.insert(image["id"]).second);
    cursor = page["next"].is_null() ? "" : page["next"].get<std::string>();
  } while (!cursor.empty());
  EXPECT_EQ(listed, uploaded);

  const Json odd = Json::parse(client.Get(std::string(kImages) + "?object=odd")->body);
  EXPECT_EQ(odd["images"].size(), 3U);
  EXPECT_TRUE(odd["next"].is_null());
  const Json first_odd =
      Json::parse(client.Get(std::string(kImages) + "?object=odd&limit=1")->body);
  const auto other_list =
      client.Get(std::string(kImages) + "?limit=1&cursor=" + first_odd["next"].get<std::string>());
  EXPECT_EQ(Json::parse(other_list->body)["code"], "invalid_cursor");

  const Json objects = Json::parse(client.Get("/v1/collections/default/objects?limit=1")->body);
  ASSERT_EQ(objects["objects"].size(), 1U);
  EXPECT_EQ(objects["objects"][0]["object"], "even ü/1");
  EXPECT_EQ(objects["objects"][0]["images"], 4);
  EXPECT_TRUE(uploaded.contains(objects["objects"][0]["image_id"].get<std::string>()));
  const std::string even = "/v1/collections/default/objects/even%20%C3%BC%2F1";
  EXPECT_EQ(Json::parse(client.Get(even)->body)["images"], 4);
  EXPECT_EQ(Json::parse(client.Delete(even)->body)["deleted"], 4);
  EXPECT_EQ(client.Get(even)->status, 404);
  EXPECT_EQ(client.Delete(even)->status, 404);
  EXPECT_EQ(Json::parse(client.Get(kImages)->body)["images"].size(), 3U);
}

TEST_F(ServerTest, CollectionsAreSeparate) {
  Start();
  auto client = server_->Client();
  EXPECT_EQ(client.Get("/v1/collections/toys")->status, 404);
  EXPECT_EQ(Upload(client, TestImage(1), "car", "toys")->status, 404);
  EXPECT_EQ(client.Put("/v1/collections/toys")->status, 201);
  EXPECT_EQ(client.Put("/v1/collections/toys")->status, 200);
  EXPECT_EQ(Upload(client, TestImage(1), "car", "toys")->status, 201);
  EXPECT_EQ(Json::parse(client.Get("/v1/collections/default")->body)["images"], 0);
  EXPECT_EQ(Json::parse(client.Get("/v1/collections/toys")->body)["images"], 1);
  const auto found = client.Post("/v1/collections/toys/search", TestImage(1, 1), "image/png");
  ASSERT_EQ(found->status, 200) << found->body;
  EXPECT_EQ(Json::parse(found->body)["hits"][0]["object"], "car");
  const Json list = Json::parse(client.Get("/v1/collections")->body)["collections"];
  ASSERT_EQ(list.size(), 2U);
  EXPECT_EQ(list[0]["name"], "default");
  EXPECT_EQ(list[1], Json::parse(client.Get("/v1/collections/toys")->body));
  EXPECT_EQ(client.Delete("/v1/collections/toys")->status, 204);
  EXPECT_EQ(client.Delete("/v1/collections/toys")->status, 404);
  EXPECT_EQ(client.Delete("/v1/collections/default")->status, 409);
}

TEST_F(ServerTest, PageHealthAndMetrics) {
  Start();
  auto client = server_->Client();
  const auto page = client.Get("/");
  ASSERT_EQ(page->status, 200);
  EXPECT_THAT(page->get_header_value("Content-Type"), ::testing::StartsWith("text/html"));
  EXPECT_THAT(page->get_header_value("Content-Security-Policy"),
              ::testing::HasSubstr("default-src 'none'"));
  EXPECT_EQ(client.Get("/?utm_source=mail&fbclid=1")->body, page->body) << "links gain parameters";
  // The page needs nothing from elsewhere (the icon's XML name space is a name, not a place).
  EXPECT_THAT(std::regex_replace(page->body, std::regex("http://www.w3.org/2000/svg"), ""),
              ::testing::Not(::testing::HasSubstr("://")));
  for (const std::string asset : {"base.css", "app.js", "api.js", "results.js"}) {
    const auto answer = client.Get("/assets/" + asset);
    EXPECT_EQ(answer->status, 200) << asset;
    EXPECT_GT(answer->body.size(), 500U) << asset;
  }
  EXPECT_EQ(client.Get("/livez")->status, 200);
  EXPECT_EQ(client.Get("/readyz")->status, 200);
  client.Get("/v1/nothing");
  const std::string metrics = client.Get("/metrics")->body;
  EXPECT_THAT(metrics, ::testing::HasSubstr("pliant_images 0"));
  EXPECT_THAT(metrics, ::testing::HasSubstr(R"(route="livez")"));
  EXPECT_THAT(metrics, ::testing::HasSubstr("pliant_http_request_seconds_bucket"));
  EXPECT_THAT(metrics, ::testing::Not(::testing::HasSubstr("nothing")));  // no series by clients
  EXPECT_EQ(Metric(client, "pliant_images"), 0);
  EXPECT_THROW(Metric(client, "pliant_nothing"), std::runtime_error);
}

TEST_F(ServerTest, RequestIdsAndLog) {
  Start();
  auto client = server_->Client();
  const auto mine = client.Get("/livez", httplib::Headers{{"X-Request-Id", "abc-1"}});
  EXPECT_EQ(mine->get_header_value("X-Request-Id"), "abc-1");
  const auto bad = client.Get("/livez", httplib::Headers{{"X-Request-Id", "a b%0d%0aX: y"}});
  EXPECT_THAT(bad->get_header_value("X-Request-Id"), ::testing::MatchesRegex("[0-9a-f]{16}"));
  client.Get("/v1/collections/default/images?object=secret");
  EXPECT_EQ(server_->Stop(), 0);
  EXPECT_THAT(server_->Log(), ::testing::HasSubstr("GET /livez 200 livez"));
  EXPECT_THAT(server_->Log(), ::testing::HasSubstr("id=abc-1"));
  EXPECT_THAT(server_->Log(), ::testing::Not(::testing::HasSubstr("secret")));
}

}  // namespace
}  // namespace pliant::testing
