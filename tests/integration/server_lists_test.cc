// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Lists over HTTP: conditions, order, counts, cursors; deletion by filter.
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kObjects = "/v1/collections/default/objects";

class ListsTest : public ServerTest {
 protected:
  void SetUp() override {
    Start({"--auto-train", "false"});
    client_ = std::make_unique<httplib::Client>(server_->Client());
    Put("a1", "mug", R"({"shop":"east","n":1})", 1);
    Put("a2", "mug", R"({"shop":"west","n":2})", 2);
    Put("b1", "Tasse Ü", R"({"shop":"east","n":3,"tags":["x","y"]})", 3);
    Put("b2", "", R"({"n":4})", 4);
    Put("b3", "Tasse Ü", R"({"shop":"east","n":5})", 5);
  }
  void Put(const std::string& id, const std::string& object, const std::string& metadata,
           std::uint64_t seed) {
    const auto answer = client_->Put(
        std::string(kImages) + "/" + id + "?" + Query({{"object", object}, {"metadata", metadata}}),
        TestImage(seed), "image/png");
    ASSERT_TRUE(answer && answer->status == 201) << (answer ? answer->body : "no answer");
  }
  static std::string Query(const httplib::Params& parameters) {
    return httplib::detail::params_to_query_str(parameters);
  }
  httplib::Result Get(const std::string& path, const httplib::Params& parameters) {
    return client_->Get(path + "?" + Query(parameters));
  }
  Json List(const std::string& path, const httplib::Params& parameters) {
    const auto answer = Get(path, parameters);
    EXPECT_TRUE(answer && answer->status == 200) << (answer ? answer->body : "no answer");
    return answer ? Json::parse(answer->body) : Json::object();
  }
  std::vector<std::string> Ids(const httplib::Params& parameters) {
    std::vector<std::string> ids;
    const Json page = List(kImages, parameters);
    for (const Json& image : page["images"]) ids.push_back(image["id"]);
    return ids;
  }
  void Refused(const std::string& path, const httplib::Params& parameters, const std::string& code,
               const std::string& parameter, const std::string& detail = "") {
    const auto answer = Get(path, parameters);
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->status, 400) << answer->body;
    const Json problem = Json::parse(answer->body);
    EXPECT_EQ(problem["code"], code) << answer->body;
    EXPECT_EQ(problem.value("parameter", ""), parameter) << answer->body;
    EXPECT_THAT(problem["detail"].get<std::string>(), HasSubstr(detail));
  }

  std::unique_ptr<httplib::Client> client_;
};

TEST_F(ListsTest, ImagesByFilterTextAndOrder) {
  EXPECT_THAT(Ids({{"filter", R"({"shop": {"ne": "east"}})"}}), ElementsAre("a2"));
  EXPECT_THAT(Ids({{"filter", R"({"not": {"shop": "east"}})"}}), ElementsAre("a2", "b2"));
  EXPECT_THAT(Ids({{"q", "TASSE ü"}, {"sort", "-id"}}), ElementsAre("b3", "b1"));
  EXPECT_THAT(Ids({{"q", ""}, {"sort", "-created"}}), ElementsAre("b3", "b2", "b1", "a2", "a1"));
  EXPECT_THAT(Ids({{"sort", "object"}}), ElementsAre("b2", "b1", "b3", "a1", "a2"));
  EXPECT_THAT(Ids({{"object", "mug"}, {"q", "a1"}}), ElementsAre("a1"));
  EXPECT_THAT(Ids({{"sort", "-metadata.n"}}), ElementsAre("b3", "b2", "b1", "a2", "a1"));
  EXPECT_THAT(Ids({{"sort", "metadata.shop"}, {"limit", "2"}}), ElementsAre("b2", "a1"));
  EXPECT_THAT(Ids({{"filter", R"({"shop": {"prefix": "W"}})"}}), ElementsAre("a2"));
  EXPECT_THAT(Ids({{"q", "%"}}), ElementsAre()) << "no pattern";
  ASSERT_EQ(client_
                ->Patch(std::string(kImages) + "/a1", R"({"metadata": {"seen": true}})",
                        "application/merge-patch+json")
                ->status,
            200);
  EXPECT_EQ(Ids({{"sort", "-updated"}}).front(), "a1");
  EXPECT_EQ(Ids({{"sort", "-created"}}).back(), "a1");
}

TEST_F(ListsTest, CountAndFacetsAreOfAllPages) {
  const Json page = List(kImages, {{"limit", "1"}, {"count", "true"}, {"facets", "shop,tags"}});
  EXPECT_EQ(page["images"].size(), 1U);
  EXPECT_EQ(page["total"], 5);
  EXPECT_EQ(
      page["facets"]["shop"],
      Json::parse(R"({"values": [{"value": "east", "count": 3}, {"value": "west", "count": 1}],
                            "without": 1, "complete": true})"));
  EXPECT_EQ(page["facets"]["tags"]["values"].size(), 2U);
  EXPECT_EQ(page["facets"]["tags"]["without"], 4);
  const Json plain = List(kImages, {});
  EXPECT_FALSE(plain.contains("total"));
  EXPECT_FALSE(plain.contains("facets"));
  EXPECT_EQ(List(kImages, {{"count", "true"}, {"filter", R"({"n": {"gt": 3}})"}})["total"], 2);
}

TEST_F(ListsTest, CursorsBelongToTheirList) {
  const httplib::Params asked = {{"sort", "-created"}, {"q", "a"}, {"limit", "1"}};
  std::vector<std::string> ids;
  Json page = List(kImages, asked);
  const std::string first = page["next"];
  while (true) {
    for (const Json& image : page["images"]) ids.push_back(image["id"]);
    if (page["next"].is_null()) break;
    httplib::Params next = asked;
    next.emplace("cursor", page["next"].get<std::string>());
    page = List(kImages, next);
  }
  EXPECT_THAT(ids, ElementsAre("b3", "b1", "a2", "a1"));
  // How much a page shows may change; what is listed may not.
  EXPECT_THAT(Ids({{"sort", "-created"}, {"q", "a"}, {"limit", "2"}, {"cursor", first}}),
              ElementsAre("b1", "a2"));
  for (const httplib::Params& other : std::vector<httplib::Params>{
           {{"sort", "created"}, {"q", "a"}},
           {{"sort", "-created"}, {"q", "b"}},
           {{"sort", "-created"}},
           {{"sort", "-created"}, {"q", "a"}, {"object", "mug"}},
           {{"sort", "-created"}, {"q", "a"}, {"filter", R"({"n": 1})"}}}) {
    httplib::Params with = other;
    with.emplace("cursor", first);
    Refused(kImages, with, "invalid_cursor", "cursor");
  }
  Refused(kObjects, {{"cursor", first}}, "invalid_cursor", "cursor");
  Refused(kImages, {{"cursor", "x"}}, "invalid_cursor", "cursor");
}

TEST_F(ListsTest, Objects) {
  const Json all = List(kObjects, {{"sort", "-images"}, {"count", "true"}, {"facets", "shop"}});
  EXPECT_EQ(all["total"], 2);
  ASSERT_EQ(all["objects"].size(), 2U);
  EXPECT_EQ(all["objects"][0]["images"], 2);
  EXPECT_EQ(all["facets"]["shop"]["values"][0], Json::parse(R"({"value": "east", "count": 2})"));
  const Json found = List(kObjects, {{"q", "ü"}});
  ASSERT_EQ(found["objects"].size(), 1U);
  EXPECT_EQ(found["objects"][0]["object"], "Tasse Ü");
  EXPECT_EQ(found["objects"][0]["image_id"], "b1");
  EXPECT_EQ(List(kObjects, {{"filter", R"({"shop": "west"})"}})["objects"].size(), 1U);
  const Json one = List(kObjects, {{"limit", "1"}, {"sort", "-object"}});
  EXPECT_EQ(one["objects"][0]["object"], "mug");
  const Json other = List(kObjects, {{"limit", "1"}, {"sort", "-object"}, {"cursor", one["next"]}});
  EXPECT_EQ(other["objects"][0]["object"], "Tasse Ü");
  EXPECT_TRUE(other["next"].is_null());
}

TEST_F(ListsTest, WhatIsWrongIsNamed) {
  for (const char* path : {kImages, kObjects}) {
    Refused(path, {{"filter", "[1]"}}, "invalid_json", "filter");
    Refused(path, {{"filter", R"({"or": [{"n": 1}, {"n": {"in": 3}}]})"}}, "invalid_parameter",
            "filter", "filter.or[1].n");
    Refused(path, {{"filter", R"({"n": {"gt": NaN}})"}}, "invalid_json", "filter");
    Refused(path, {{"sort", "size"}}, "invalid_parameter", "sort", "-created");
    Refused(path, {{"count", "yes"}}, "invalid_parameter", "count");
    Refused(path, {{"facets", "a,,b"}}, "invalid_parameter", "facets");
    Refused(path, {{"facets", "a,a"}}, "invalid_parameter", "facets");
    Refused(path, {{"facets", "a,b,c,d,e,f,g,h,i,j,k,l,m,n,o,p,q"}}, "invalid_parameter", "facets");
    Refused(path, {{"q", std::string(513, 'x')}}, "invalid_parameter", "q");
    Refused(path, {{"q", "\xff"}}, "invalid_parameter", "q", "UTF-8");
    Refused(path, {{"limit", "0"}}, "invalid_parameter", "limit");
    Refused(path, {{"order", "id"}}, "unknown_parameter", "order");
  }
  EXPECT_EQ(client_->Get("/v1/collections/none/images?sort=id")->status, 404);
}

TEST_F(ListsTest, DeletionByFilter) {
  const auto remove = [&](const httplib::Params& parameters) {
    return client_->Delete(std::string(kImages) + "?" + Query(parameters));
  };
  const auto refused = [&](const httplib::Params& parameters, const std::string& code) {
    const auto answer = remove(parameters);
    EXPECT_EQ(answer->status, 400) << answer->body;
    EXPECT_EQ(Json::parse(answer->body)["code"], code) << answer->body;
    EXPECT_EQ(Json::parse(answer->body)["parameter"], "filter") << answer->body;
  };
  refused({}, "missing_parameter");
  refused({{"filter", ""}}, "invalid_json");
  refused({{"object", "mug"}}, "missing_parameter");
  refused({{"filter", "{}"}}, "invalid_parameter");
  refused({{"filter", R"({"n": {}})"}}, "invalid_parameter");
  refused({{"filter", R"({"n": 1, "n": 2})"}}, "invalid_json");
  EXPECT_EQ(Ids({}).size(), 5U) << "nothing is gone";
  auto answer = remove({{"filter", R"({"shop": "east"})"}, {"object", "mug"}});
  EXPECT_EQ(answer->status, 200);
  EXPECT_EQ(Json::parse(answer->body), (Json{{"deleted", 1}}));
  EXPECT_THAT(Ids({}), ElementsAre("a2", "b1", "b2", "b3"));
  answer = remove({{"filter", R"({"n": {"gte": 3}})"}});
  EXPECT_EQ(Json::parse(answer->body)["deleted"], 3);
  EXPECT_THAT(Ids({}), ElementsAre("a2"));
  EXPECT_EQ(List(kObjects, {})["objects"].size(), 1U);
  EXPECT_EQ(Json::parse(remove({{"filter", R"({"n": 77})"}})->body)["deleted"], 0);
}

}  // namespace
}  // namespace pliant::testing
