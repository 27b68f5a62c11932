// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a search over HTTP can be asked for, and the vocabularies it uses.
#include <thread>

#include <gmock/gmock.h>
#include <sys/resource.h>

#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;

TEST_F(ServerTest, SearchParametersDoWhatTheySay) {
  Start();
  auto client = server_->Client();
  for (int i = 0; i < 8; ++i) {
    ASSERT_EQ(Upload(client, TestImage(i / 2, i % 2), "o" + std::to_string(i / 2))->status, 201);
  }
  const std::string query = TestImage(1, 2);
  const Json objects = SearchFor(client, query);
  const Json images = SearchFor(client, query, "?group_by=image");
  EXPECT_EQ(objects["total"], 4);
  EXPECT_EQ(images["total"], 8);
  const Json page = SearchFor(client, query, "?group_by=image&limit=2&offset=3");
  EXPECT_EQ(page["hits"], Json({images["hits"][3], images["hits"][4]}));
  const Json only = SearchFor(client, query, "?object=o3&group_by=image");
  ASSERT_EQ(only["hits"].size(), 2U);
  for (const Json& hit : only["hits"]) EXPECT_EQ(hit["object"], "o3");
  EXPECT_EQ(objects["verdict"], "found");
  EXPECT_GE(objects["found"], 1);
  EXPECT_EQ(SearchFor(client, query, "?verify=none")["verdict"], nullptr);
  const double best = images["hits"][0]["score"];
  const Json good = SearchFor(client, query, "?group_by=image&min_score=0.2");
  for (const Json& hit : good["hits"]) EXPECT_GE(hit["score"], 0.2);
  EXPECT_EQ(SearchFor(client, query, "?min_score=1")["total"], best >= 1 ? 1 : 0);
  EXPECT_EQ(SearchFor(client, query, "?rank=histogram")["hits"].size(), 4U);
  // All hits, and how many of them are looked at.
  const Json all = SearchFor(client, query, "?group_by=image&limit=0&verify_depth=1&explain=true");
  EXPECT_EQ(all["hits"].size(), 8U);
  int looked_at = 0;
  for (const Json& hit : all["hits"]) looked_at += hit["explain"]["reference"].is_null() ? 0 : 1;
  EXPECT_EQ(looked_at, 1);
  EXPECT_EQ(images["hits"][0]["instances"].size(), 1U);
  EXPECT_EQ(images["hits"][0]["instances"][0]["polygon"], images["hits"][0]["polygon"]);
  // What is not found is looked at more closely, unless that is not wanted.
  EXPECT_EQ(images["looked_closer"], false);
  const std::string absent = TestImage(77, 0);
  EXPECT_EQ(SearchFor(client, absent)["looked_closer"], true);
  EXPECT_EQ(SearchFor(client, absent, "?closer_look=false")["looked_closer"], false);
  // Filters, in the query and in a JSON body.
  const std::string filtered = client
                                   .Post("/v1/collections/default/images",
                                         httplib::MultipartFormDataItems{
                                             {"image", TestImage(1, 3), "photo.png", "image/png"},
                                             {"object", "o9", "", ""},
                                             {"id", "tagged", "", ""},
                                             {"metadata", R"({"year": 2021})", "", ""}})
                                   ->body;
  const Json filter = {{"year", {{"gte", 2020}}}};
  const auto tagged = client.Post(kSearch,
                                  Json{{"image_id", "tagged"},
                                       {"exclude_self", false},
                                       {"filter", filter},
                                       {"group_by", "image"}}
                                      .dump(),
                                  "application/json");
  ASSERT_EQ(tagged->status, 200) << tagged->body << filtered;
  EXPECT_THAT(ImageIds(Json::parse(tagged->body)["hits"]), ::testing::ElementsAre("tagged"));
  const Json none = SearchFor(client, query, "?filter=%7B%22year%22%3A1999%7D");
  EXPECT_EQ(none["total"], 0);
  EXPECT_EQ(none["verdict"], "not_found");
  EXPECT_EQ(none["found"], 0);
  for (const char* wrong : {"?filter=%7B%22year%22%3A%7B%22like%22%3A1%7D%7D", "?filter=year",
                            "?verify_depth=0", "?instances=0", "?limit=-1", "?explain=maybe"}) {
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

TEST_F(ServerTest, AFullDiskIsNoReasonToSearchInVain) {
  Start();
  auto client = server_->Client();
  ASSERT_EQ(client.Post(kImages, TestImage(1), "image/png")->status, 201);
  server_->LimitFiles(4096);
  const auto vain = client.Post(kSearch, TestImage(1, 1), "image/png");
  ASSERT_TRUE(vain) << "the server lives";
  EXPECT_EQ(vain->status, 409) << vain->body;
  EXPECT_EQ(Json::parse(vain->body)["code"], "no_vocabulary");
  EXPECT_THAT(Json::parse(vain->body)["detail"].get<std::string>(), HasSubstr("disk is too full"));
  EXPECT_EQ(client.Post(kImages, TestImage(2), "image/png")->status, 507);
  server_->LimitFiles(RLIM_INFINITY);
  const auto found = client.Post(kSearch, TestImage(1, 1), "image/png");
  EXPECT_EQ(found->status, 200) << found->body;
}

TEST_F(ServerTest, VocabulariesAreTrainedAsJobsAndSwitched) {
  Start({"--auto-train", "false"});
  auto client = server_->Client();
  const std::string vocabularies = "/v1/collections/default/vocabularies";
  const auto none = client.Post(kSearch, TestImage(0), "image/png");
  EXPECT_EQ(none->status, 409);
  EXPECT_EQ(Json::parse(none->body)["code"], "no_vocabulary");
  for (int i = 0; i < 3; ++i) Upload(client, TestImage(i), "o" + std::to_string(i));

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
  const Json before = SearchFor(client, TestImage(1, 1));
  EXPECT_EQ(before["words"], 10);
  for (const Json& vocabulary : list) {
    if (vocabulary["active"]) continue;
    const auto switched = client.Put(vocabularies + "/" + vocabulary["id"].dump() + "/active",
                                     std::string(), "text/plain");
    EXPECT_EQ(switched->status, 200) << switched->body;
    EXPECT_EQ(Json::parse(switched->body)["active"], true);
  }
  const Json after = SearchFor(client, TestImage(1, 1));
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

}  // namespace
}  // namespace pliant::testing
