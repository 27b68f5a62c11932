// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a search can be asked for: filters, pages, instances, how words are compared.
#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "tests/unit/engine_options_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

TEST_F(EngineOptionsTest, OnlyImagesThatPassTheFilterAreHits) {
  Engine engine(Options());
  Fill(engine);
  const auto query = OtherViewPng(6);
  for (const Verification verify : {Verification::kNone, Verification::kTps}) {
    SearchOptions options = ByImage();
    options.verify = verify;
    options.second_pass = false;  // which only a search without p6 would take
    const SearchResult all = engine.Search(query, options);
    EXPECT_EQ(all.hits.at(0).image_id, "p6");
    options.filter = ParseFilter(R"({"shop": "east", "year": {"gt": 2003, "lte": 2008}})");
    const SearchResult some = engine.Search(query, options);
    EXPECT_THAT(Ids(some), UnorderedElementsAre("p4", "p5", "p7", "p8"));
    EXPECT_EQ(some.total, 4U);
    // The others have the scores that they had.
    std::map<std::string, double> before;
    for (const Hit& hit : all.hits) before[hit.image_id] = hit.score;
    for (const Hit& hit : some.hits) EXPECT_EQ(hit.score, before.at(hit.image_id));
    options.object = "o0";
    EXPECT_THAT(Ids(engine.Search(query, options)), UnorderedElementsAre("p4", "p8"));
    options.object = "nobody";
    EXPECT_THAT(Ids(engine.Search(query, options)), IsEmpty());
    options.object.reset();
    options.group_by = GroupBy::kObject;
    EXPECT_EQ(engine.Search(query, options).total, 3U);  // o0, o1, o3
    options.filter = ParseFilter(R"({"year": 1999})");
    EXPECT_EQ(engine.Search(query, options).total, 0U);
  }
  SearchOptions options;
  options.filter.conditions.push_back({"year", {}, {}, {}});
  ExpectError(ErrorCode::kInvalidArgument, "filter_invalid",
              [&] { engine.Search(query, options); });
}

TEST_F(EngineOptionsTest, PagesFitTogetherWhateverIsVerified) {
  Engine engine(Options());
  Fill(engine);
  const auto query = OtherViewPng(7);
  for (const GroupBy group_by : {GroupBy::kImage, GroupBy::kObject}) {
    for (const std::size_t depth : {0U, 1U, 5U}) {
      SearchOptions options = ByImage();
      options.group_by = group_by;
      options.verify_depth = depth;
      const SearchResult all = engine.Search(query, options);
      EXPECT_EQ(all.hits.at(0).image_id, "p7");
      EXPECT_EQ(all.total, all.hits.size());
      options.limit = 2;
      std::vector<std::string> pages;
      for (; options.offset < all.total; options.offset += 2) {
        const SearchResult page = engine.Search(query, options);
        EXPECT_EQ(page.total, all.total);
        ASSERT_FALSE(page.hits.empty());
        EXPECT_EQ(page.hits[0].rank, options.offset + 1);
        for (const std::string& id : Ids(page)) pages.push_back(id);
      }
      EXPECT_EQ(pages, Ids(all));
      EXPECT_TRUE(std::is_sorted(all.hits.begin(), all.hits.end(),
                                 [](const Hit& a, const Hit& b) { return a.score > b.score; }));
    }
  }
}

TEST_F(EngineOptionsTest, AnObjectThatIsThereTwiceIsFoundTwice) {
  Engine engine(Options());
  Fill(engine);
  const Image one = RandomImage(5);
  Image both{3 * one.width, one.height, 1, {}};
  both.pixels.assign(static_cast<std::size_t>(both.width) * both.height, 128);
  for (int y = 0; y < one.height; ++y) {
    for (int x = 0; x < one.width; ++x) {
      const auto grey = one.pixels[static_cast<std::size_t>(y) * one.width + x];
      both.pixels[static_cast<std::size_t>(y) * both.width + x] = grey;
      both.pixels[static_cast<std::size_t>(y) * both.width + 2 * one.width + x] = grey;
    }
  }
  const auto query = EncodePng(both);
  SearchOptions options = ByImage();
  const Hit hit = engine.Search(query, options).hits.at(0);
  EXPECT_EQ(hit.image_id, "p5");
  ASSERT_EQ(hit.instances.size(), 2U);
  EXPECT_EQ(hit.instances[0].inliers, hit.inliers);
  EXPECT_GE(hit.instances[1].inliers, 10);
  std::set<bool> right;
  for (const Instance& instance : hit.instances) {
    ASSERT_GE(instance.polygon.size(), 3U);
    double x = 0;
    for (const Point& p : instance.polygon) x += p.x / static_cast<double>(instance.polygon.size());
    right.insert(x > 1.5 * one.width);
    EXPECT_NEAR(x, x > 1.5 * one.width ? 2.5 * one.width : 0.5 * one.width, 15);
  }
  EXPECT_EQ(right.size(), 2U);
  options.max_instances = 1;
  EXPECT_EQ(engine.Search(query, options).hits.at(0).instances.size(), 1U);
  // What is there once is found once.
  options.max_instances = 4;
  EXPECT_EQ(engine.Search(OtherViewPng(5), options).hits.at(0).instances.size(), 1U);
  options.max_instances = 0;
  ExpectError(ErrorCode::kInvalidArgument, "max_instances_invalid",
              [&] { engine.Search(query, options); });
}

}  // namespace
}  // namespace pliant::testing
