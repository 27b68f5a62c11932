// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Searches with stored images, one or several, without finding these themselves; two images
// compared.
#include <algorithm>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

using ExamplesTest = EngineTest;

TEST_F(ExamplesTest, ExcludedImagesAreNoHits) {
  Engine engine(Options());
  AddMany(engine, 6);
  Train(engine);
  SearchOptions options = ByImage(0);
  const std::vector<std::string> all = Ids(engine.SearchStored("p3", options));
  ASSERT_FALSE(all.empty());
  EXPECT_EQ(all.front(), "p3");
  options.without = {"p3", "unknown"};
  std::vector<std::string> rest = Ids(engine.SearchStored("p3", options));
  EXPECT_EQ(std::count(rest.begin(), rest.end(), "p3"), 0);
  options.without.assign(kMaxExcluded + 1, "x");
  ExpectError(ErrorCode::kInvalidArgument, "without_invalid",
              [&] { engine.SearchStored("p3", options); });
}

TEST_F(ExamplesTest, SeveralExamplesFindWhatIsLikeAnyOfThem) {
  Engine engine(Options());
  AddMany(engine, 4);
  // The same bytes once more: what is found by each example.
  for (const auto& [id, seed] : {std::pair{"copy1", 1U}, {"copy3", 3U}}) {
    Add(engine, RandomPng(seed), "copies", id);
  }
  Train(engine);
  const SearchOptions options = ByImage(0);
  const SearchResult result = engine.SearchExamples({"p1", "p3"}, options);
  ASSERT_GE(result.hits.size(), 2U);
  const std::set<std::string> best = {result.hits[0].image_id, result.hits[1].image_id};
  EXPECT_EQ(best, (std::set<std::string>{"copy1", "copy3"}));
  for (const Hit& hit : result.hits) {
    EXPECT_NE(hit.image_id, "p1");
    EXPECT_NE(hit.image_id, "p3");
    if (best.contains(hit.image_id)) {
      EXPECT_EQ(hit.example, hit.image_id == "copy3" ? "p3" : "p1");
    }
  }
  ASSERT_EQ(result.examples.size(), 2U);
  EXPECT_EQ(result.examples[1].image_id, "p3");
  EXPECT_GT(result.examples[1].width, 0);
  EXPECT_EQ(result.found, 2U);
  SearchOptions without = options;
  without.without = {"p1", "p3"};
  const auto score = [](const SearchResult& r, const std::string& id) {
    for (const Hit& hit : r.hits) {
      if (hit.image_id == id) return hit.score;
    }
    return 0.0;
  };
  const SearchResult one = engine.SearchStored("p1", without);
  const SearchResult other = engine.SearchStored("p3", without);
  for (const Hit& hit : result.hits) {
    EXPECT_NEAR(hit.score, 1 - (1 - score(one, hit.image_id)) * (1 - score(other, hit.image_id)),
                1e-12)
        << hit.image_id;
  }
  SearchOptions page = options;
  page.limit = 1;
  page.offset = 1;
  const SearchResult second = engine.SearchExamples({"p1", "p3"}, page);
  ASSERT_EQ(second.hits.size(), 1U);
  EXPECT_EQ(second.hits[0].image_id, result.hits[1].image_id);
  EXPECT_EQ(second.hits[0].rank, 2U);
  EXPECT_EQ(second.total, result.total);
  SearchOptions objects = options;
  objects.group_by = GroupBy::kObject;
  EXPECT_EQ(engine.SearchExamples({"p1", "p3"}, objects).hits.at(0).object, "copies");
}

TEST_F(ExamplesTest, ExamplesThatAreNoneAreNamed) {
  Engine engine(Options());
  AddMany(engine, 2);
  Train(engine);
  const auto refused = [&](ErrorCode code, const char* reason, const std::vector<std::string>& ids,
                           SearchOptions options = {}) {
    ExpectError(code, reason, [&] { engine.SearchExamples(ids, options); });
  };
  refused(ErrorCode::kInvalidArgument, "examples_invalid", {});
  refused(ErrorCode::kInvalidArgument, "examples_invalid", {"p1", "p1"});
  refused(ErrorCode::kInvalidArgument, "examples_invalid",
          std::vector<std::string>(kMaxExamples + 1, "p1"));
  refused(ErrorCode::kNotFound, "image_not_found", {"p1", "p9"});
  SearchOptions region;
  region.region = Region{0, 0, 10, 10};
  refused(ErrorCode::kInvalidArgument, "region_invalid", {"p1"}, region);
}

TEST_F(ExamplesTest, TwoImagesAreCompared) {
  Engine engine(Options());
  const Comparison same = engine.Compare(RandomPng(1), RandomPng(1), 1);
  EXPECT_TRUE(same.found());
  EXPECT_GE(same.probability, 0.99);
  EXPECT_FALSE(same.outline.empty());
  EXPECT_EQ(same.first.width, same.second.width);
  EXPECT_GT(same.explanation.inliers.size(), 20U);
  const Comparison other = engine.Compare(RandomPng(1), RandomPng(2), 1);
  EXPECT_FALSE(other.found());
  EXPECT_LT(other.probability, 0.5);
  EXPECT_THAT(engine.ListPage(ImageListing()).records, IsEmpty()) << "nothing is stored";
}

// The first image is a small part of the second: 40 of 900 pixels wide.
TEST_F(ExamplesTest, AComparisonMakesASecondPassIfNothingIsFound) {
  Engine engine(Options());
  const Image print = RandomImage(1, 320, 240);
  const Image small = ResizeImage(print, 40, 30);
  Image scene = RandomImage(2, 900, 660);
  const Comparison without = engine.Compare(EncodePng(print), EncodePng(scene), 1);
  EXPECT_FALSE(without.found());
  for (int y = 0; y < small.height; ++y) {
    std::copy_n(small.pixels.begin() + y * small.width, small.width,
                scene.pixels.begin() + (100 + y) * scene.width + 150);
  }
  const Comparison seen = engine.Compare(EncodePng(print), EncodePng(scene), 1);
  EXPECT_GT(seen.probability, 0.8);
  const Comparison at_once = engine.Compare(EncodePng(scene), EncodePng(scene), 1);
  EXPECT_GT(seen.second.keypoints, at_once.second.keypoints * 5 / 4);
  EXPECT_GT(seen.explanation.inliers.size(), 8U);
  ASSERT_FALSE(seen.outline.empty());
  for (const Point& p : seen.outline) {
    EXPECT_TRUE(p.x > 130 && p.x < 200 && p.y > 80 && p.y < 145) << p.x << ' ' << p.y;
  }
}

}  // namespace
}  // namespace pliant::testing
