// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The main job over HTTP: upload, search, list, delete, restart.
#include <regex>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/server_process.h"

namespace pliant::testing {
namespace {

constexpr const char* kImages = "/v1/collections/default/images";
constexpr const char* kSearch = "/v1/collections/default/search";

httplib::Result Upload(httplib::Client& client, const std::string& picture,
                       const std::string& object, const std::string& collection = "default") {
  return client.Post("/v1/collections/" + collection + "/images",
                     httplib::MultipartFormDataItems{{"image", picture, "photo.png", "image/png"},
                                                     {"object", object, "", ""}});
}

Json SearchFor(httplib::Client& client, const std::string& picture, const std::string& query = "") {
  const auto answer = client.Post(kSearch + query, picture, "image/png");
  EXPECT_TRUE(answer && answer->status == 200) << (answer ? answer->body : "no answer");
  return answer ? Json::parse(answer->body) : Json::object();
}

std::vector<std::string> ImageIds(const Json& hits) {
  std::vector<std::string> ids;
  for (const Json& hit : hits) ids.push_back(hit["image_id"]);
  return ids;
}

class ServerTest : public ::testing::Test {
 protected:
  void Start(const std::vector<std::string>& flags = {}) {
    server_ = std::make_unique<ServerProcess>(folder_.path() / "test.db", flags);
  }
  void TearDown() override {
    if (HasFailure() && server_) std::cerr << server_->Log();
  }

  TemporaryFolder folder_;
  std::unique_ptr<ServerProcess> server_;
};

TEST_F(ServerTest, UploadSearchDeleteRestart) {
  Start();
  auto client = server_->Client();
  constexpr int kObjects = 6;
  std::vector<std::string> ids;
  for (int object = 0; object < kObjects; ++object) {
    const auto answer = Upload(client, TestPicture(object), "thing " + std::to_string(object));
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
    const Json found = SearchFor(client, TestPicture(object, 1));
    ASSERT_FALSE(found["hits"].empty());
    EXPECT_EQ(found["hits"][0]["object"], "thing " + std::to_string(object)) << found;
    EXPECT_EQ(found["hits"][0]["rank"], 1);
    EXPECT_GT(found["hits"][0]["score"], 0);
    EXPECT_LE(found["hits"][0]["score"], 1);
  }
  // A stored picture finds itself.
  const auto by_id =
      client.Post(kSearch, Json{{"image_id", ids[2]}, {"limit", 2}}.dump(), "application/json");
  ASSERT_EQ(by_id->status, 200) << by_id->body;
  EXPECT_EQ(Json::parse(by_id->body)["hits"][0]["image_id"], ids[2]);

  ASSERT_EQ(client.Delete(kImages + ("/" + ids[3]))->status, 204);
  EXPECT_EQ(client.Get(kImages + ("/" + ids[3]))->status, 404);
  EXPECT_EQ(client.Delete(kImages + ("/" + ids[3]))->status, 404);
  const auto gone = ::testing::Not(::testing::Contains(ids[3]));
  EXPECT_THAT(ImageIds(SearchFor(client, TestPicture(3, 1), "?limit=100")["hits"]), gone);

  EXPECT_EQ(server_->Stop(), 0) << server_->Log();
  Start();
  auto again = server_->Client();
  EXPECT_EQ(again.Get(kImages + ("/" + ids[3]))->status, 404);
  EXPECT_THAT(ImageIds(SearchFor(again, TestPicture(3, 1), "?limit=100")["hits"]), gone);
  EXPECT_EQ(SearchFor(again, TestPicture(4, 1))["hits"][0]["object"], "thing 4");
}

TEST_F(ServerTest, SameBytesTwiceIsNoWorkTwice) {
  Start({"--auto-train", "false"});
  auto client = server_->Client();
  const std::string picture = TestPicture(1);
  const auto first = Upload(client, picture, "cup");
  const auto second = Upload(client, picture, "cup");
  ASSERT_EQ(first->status, 201);
  EXPECT_EQ(second->status, 200);
  EXPECT_EQ(first->body, second->body);
  EXPECT_EQ(second->get_header_value("Content-Location"), first->get_header_value("Location"));

  const std::string path = std::string(kImages) + "/mine?object=cup";
  const auto created = client.Put(path, picture, "image/png");
  const auto same = client.Put(path, picture, "image/png");
  EXPECT_EQ(created->status, 201) << created->body;
  EXPECT_EQ(same->status, 200);
  EXPECT_EQ(created->body, same->body);  // added_at too: nothing was written
  const auto replaced = client.Put(path, TestPicture(2), "image/png");
  EXPECT_EQ(replaced->status, 200);
  EXPECT_NE(Json::parse(replaced->body)["sha256"], Json::parse(created->body)["sha256"]);
  EXPECT_EQ(Json::parse(client.Get("/v1/collections/default")->body)["images"], 2);
}

TEST_F(ServerTest, KeepsContentMetadataThumbnailAndFeatures) {
  Start({"--auto-train", "false"});
  auto client = server_->Client();
  const std::string picture = TestPicture(5);
  const auto created = client.Post(
      kImages, httplib::MultipartFormDataItems{{"image", picture, "../../etc/a b.png", "image/png"},
                                               {"id", "shelf:4", "", ""},
                                               {"metadata", R"({"shelf": 4})", "", ""}});
  ASSERT_EQ(created->status, 201) << created->body;
  const Json image = Json::parse(created->body);
  EXPECT_EQ(image["metadata"]["shelf"], 4);
  EXPECT_EQ(image["source"], "a b.png");
  const std::string path = created->get_header_value("Location");
  EXPECT_EQ(path, std::string(kImages) + "/shelf:4");  // the client decodes header values

  const auto content = client.Get(path + "/content");
  EXPECT_EQ(content->body, picture);
  EXPECT_EQ(content->get_header_value("Content-Type"), "image/png");
  EXPECT_EQ(content->get_header_value("X-Content-Type-Options"), "nosniff");
  // By hand: the client library waits for a body of a 304, which has none.
  const std::string unchanged =
      server_->Talk("GET " + path + "/content HTTP/1.1\r\nHost: x\r\nConnection: close\r\n" +
                    "If-None-Match: " + content->get_header_value("ETag") + "\r\n\r\n");
  EXPECT_THAT(unchanged, ::testing::StartsWith("HTTP/1.1 304 "));
  EXPECT_THAT(unchanged, ::testing::EndsWith("\r\n\r\n"));
  EXPECT_THAT(unchanged, ::testing::Not(::testing::HasSubstr("Content-Length")));
  const auto head = client.Head(path + "/content");
  EXPECT_EQ(head->status, 200);
  EXPECT_EQ(head->get_header_value("Content-Length"), std::to_string(picture.size()));

  const auto thumbnail = client.Get(path + "/thumbnail");
  EXPECT_EQ(thumbnail->get_header_value("Content-Type"), "image/jpeg");
  EXPECT_EQ(thumbnail->body.substr(0, 2), "\xff\xd8");
  EXPECT_EQ(client.Get(path + "/thumbnail")->body, thumbnail->body);

  const Json features = Json::parse(client.Get(path + "/features")->body);
  EXPECT_EQ(features["model_id"], "rootsift:1");
  EXPECT_EQ(features["keypoints"].size(), image["keypoints"]);
  EXPECT_EQ(features["descriptors"]["rows"], image["keypoints"]);
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
    const auto answer = Upload(client, TestPicture(i), i % 2 == 0 ? "even ü/1" : "odd");
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

TEST_F(ServerTest, SearchParametersDoWhatTheySay) {
  Start();
  auto client = server_->Client();
  for (int i = 0; i < 8; ++i) {
    ASSERT_EQ(Upload(client, TestPicture(i / 2, i % 2), "o" + std::to_string(i / 2))->status, 201);
  }
  const std::string query = TestPicture(1, 2);
  const Json objects = SearchFor(client, query);
  const Json images = SearchFor(client, query, "?group_by=image");
  EXPECT_EQ(objects["total"], 4);
  EXPECT_EQ(images["total"], 8);
  const Json page = SearchFor(client, query, "?group_by=image&limit=2&offset=3");
  EXPECT_EQ(page["hits"], Json({images["hits"][3], images["hits"][4]}));
  const Json only = SearchFor(client, query, "?object=o3&group_by=image");
  ASSERT_EQ(only["hits"].size(), 2U);
  for (const Json& hit : only["hits"]) EXPECT_EQ(hit["object"], "o3");
  const double best = images["hits"][0]["score"];
  for (const Json& hit : SearchFor(client, query, "?group_by=image&min_score=0.2")["hits"]) {
    EXPECT_GE(hit["score"], 0.2);
  }
  EXPECT_EQ(SearchFor(client, query, "?min_score=1")["total"], best >= 1 ? 1 : 0);
  EXPECT_EQ(SearchFor(client, query, "?rank=histogram")["hits"].size(), 4U);
  // All hits, and how many of them are looked at.
  const Json all =
      SearchFor(client, query, "?group_by=image&limit=0&verify_depth=1&expand=0&explain=true");
  EXPECT_EQ(all["hits"].size(), 8U);
  int looked_at = 0;
  for (const Json& hit : all["hits"]) looked_at += hit["explain"]["reference"].is_null() ? 0 : 1;
  EXPECT_EQ(looked_at, 1);
  EXPECT_EQ(images["hits"][0]["instances"].size(), 1U);
  EXPECT_EQ(images["hits"][0]["instances"][0]["polygon"], images["hits"][0]["polygon"]);
  // Filters, in the query and in a JSON body.
  const std::string filtered = client
                                   .Post("/v1/collections/default/images",
                                         httplib::MultipartFormDataItems{
                                             {"image", TestPicture(1, 3), "photo.png", "image/png"},
                                             {"object", "o9", "", ""},
                                             {"id", "tagged", "", ""},
                                             {"metadata", R"({"year": 2021})", "", ""}})
                                   ->body;
  const Json filter = {{"year", {{"gte", 2020}}}};
  const auto tagged = client.Post(
      kSearch, Json{{"image_id", "tagged"}, {"filter", filter}, {"group_by", "image"}}.dump(),
      "application/json");
  ASSERT_EQ(tagged->status, 200) << tagged->body << filtered;
  EXPECT_THAT(ImageIds(Json::parse(tagged->body)["hits"]), ::testing::ElementsAre("tagged"));
  EXPECT_EQ(SearchFor(client, query, "?filter=%7B%22year%22%3A1999%7D")["total"], 0);
  for (const char* wrong :
       {"?filter=%7B%22year%22%3A%7B%22like%22%3A1%7D%7D", "?filter=year", "?verify_depth=0",
        "?expand=21", "?instances=0", "?limit=-1", "?explain=maybe"}) {
    const auto answer = client.Post(kSearch + std::string(wrong), query, "image/png");
    EXPECT_EQ(answer->status, 400) << wrong;
    const std::string name = std::string(wrong).substr(1, std::string(wrong).find('=') - 1);
    EXPECT_EQ(Json::parse(answer->body)["parameter"], name) << answer->body;
  }
  EXPECT_EQ(client.Delete(kImages + std::string("/tagged"))->status, 204);
  const Json explained = SearchFor(client, query, "?explain=true");
  EXPECT_EQ(explained["query"], Json({{"width", 320}, {"height", 240}}));
  const Json& why = explained["hits"][0]["explain"];
  EXPECT_EQ(why["verified"], true) << why;
  EXPECT_TRUE(why["failure"].is_null());
  EXPECT_EQ(why["pairs"].size(), explained["hits"][0]["inliers"]);
  EXPECT_EQ(why["mesh"]["reference_width"], 320);
  EXPECT_FALSE(objects["hits"][0].contains("explain"));
  const Json part = SearchFor(client, query, "?region=0,0,200,240");
  EXPECT_LT(part["keypoints"], objects["keypoints"]);
  EXPECT_EQ(part["hits"][0]["object"], "o1");
}

TEST_F(ServerTest, VocabulariesAreTrainedAsJobsAndSwitched) {
  Start({"--auto-train", "false"});
  auto client = server_->Client();
  const std::string vocabularies = "/v1/collections/default/vocabularies";
  const auto none = client.Post(kSearch, TestPicture(0), "image/png");
  EXPECT_EQ(none->status, 409);
  EXPECT_EQ(Json::parse(none->body)["code"], "no_vocabulary");
  for (int i = 0; i < 3; ++i) Upload(client, TestPicture(i), "o" + std::to_string(i));

  for (const int words : {10, 20}) {
    const auto accepted = client.Post(
        vocabularies, Json{{"words", words}, {"seed", 3}, {"activate", words == 10}}.dump(),
        "application/json");
    ASSERT_EQ(accepted->status, 202) << accepted->body;
    const std::string job_path = accepted->get_header_value("Location");
    Json job;
    do {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      job = Json::parse(client.Get(job_path)->body);
    } while (job["state"] == "queued" || job["state"] == "running");
    EXPECT_EQ(job["state"], "done") << job;
    EXPECT_EQ(job["done"], job["total"]);
  }
  const Json list = Json::parse(client.Get(vocabularies)->body)["vocabularies"];
  ASSERT_EQ(list.size(), 2U);
  const Json before = SearchFor(client, TestPicture(1, 1));
  EXPECT_EQ(before["words"], 10);
  for (const Json& vocabulary : list) {
    if (vocabulary["active"]) continue;
    const auto switched = client.Put(vocabularies + "/" + vocabulary["id"].dump() + "/active",
                                     std::string(), "text/plain");
    EXPECT_EQ(switched->status, 200) << switched->body;
    EXPECT_EQ(Json::parse(switched->body)["active"], true);
  }
  const Json after = SearchFor(client, TestPicture(1, 1));
  EXPECT_EQ(after["words"], 20);
  EXPECT_NE(after["vocabulary"], before["vocabulary"]);

  const auto failed = client.Post(vocabularies, R"({"words": 30000})", "application/json");
  const std::string failed_path = failed->get_header_value("Location");
  Json job;
  do {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    job = Json::parse(client.Get(failed_path)->body);
  } while (job["state"] == "queued" || job["state"] == "running");
  EXPECT_EQ(job["state"], "failed");
  EXPECT_EQ(job["problem"]["parameter"], "words") << job;
}

TEST_F(ServerTest, CollectionsAreSeparate) {
  Start();
  auto client = server_->Client();
  EXPECT_EQ(client.Get("/v1/collections/toys")->status, 404);
  EXPECT_EQ(Upload(client, TestPicture(1), "car", "toys")->status, 404);
  EXPECT_EQ(client.Put("/v1/collections/toys")->status, 201);
  EXPECT_EQ(client.Put("/v1/collections/toys")->status, 200);
  EXPECT_EQ(Upload(client, TestPicture(1), "car", "toys")->status, 201);
  EXPECT_EQ(Json::parse(client.Get("/v1/collections/default")->body)["images"], 0);
  EXPECT_EQ(Json::parse(client.Get("/v1/collections/toys")->body)["images"], 1);
  const auto found = client.Post("/v1/collections/toys/search", TestPicture(1, 1), "image/png");
  ASSERT_EQ(found->status, 200) << found->body;
  EXPECT_EQ(Json::parse(found->body)["hits"][0]["object"], "car");
  EXPECT_EQ(Json::parse(client.Get("/v1/collections")->body)["collections"],
            Json({"default", "toys"}));
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
