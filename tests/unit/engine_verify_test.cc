// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Search with verification, through the engine.
#include <algorithm>
#include <map>
#include <random>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "index/engine/engine.h"
#include "index/verify/judgement.h"
#include "tests/unit/index_test_images.h"
#include "tests/unit/test_database.h"

namespace pliant {
namespace {

using testing::OtherViewPng;
using testing::RandomPng;
using testing::TemporaryFolder;

class EngineVerifyTest : public ::testing::TestWithParam<const char*> {
 protected:
  static constexpr int kObjects = 8;

  EngineVerifyTest() : engine_(Options()) {
    for (int i = 1; i <= kObjects; ++i) {
      Add(RandomPng(static_cast<std::uint64_t>(i)), i, "a");
    }
    TrainOptions train;
    train.words = 8;  // few words: the ranking alone knows little
    train.sample = 2000;
    engine_.TrainVocabulary(train);
  }
  EngineOptions Options() {
    EngineOptions options;
    options.database = testing::Database(folder_ / "a.db");
    options.descriptor = GetParam();
    return options;
  }
  void Add(const std::vector<std::uint8_t>& bytes, int object, const std::string& suffix) {
    AddRequest request;
    request.bytes = bytes;
    request.object = "o" + std::to_string(object);
    request.id = "p" + std::to_string(object) + suffix;
    engine_.Add(request);
  }
  SearchResult Search(int object, Verification verify, std::size_t depth = 0) {
    SearchOptions options;
    options.limit = 0;
    options.verify = verify;
    options.verify_depth = depth;
    return engine_.Search(OtherViewPng(static_cast<std::uint64_t>(object)), options);
  }

  TemporaryFolder folder_;
  Engine engine_;
};

TEST_P(EngineVerifyTest, TheRightObjectComesFirstWithItsOutline) {
  for (int object = 1; object <= kObjects; ++object) {
    const SearchResult plain = Search(object, Verification::kNone);
    const SearchResult verified = Search(object, Verification::kTps);
    ASSERT_FALSE(verified.hits.empty());
    const Hit& best = verified.hits[0];
    EXPECT_EQ(best.object, "o" + std::to_string(object));
    EXPECT_GE(best.inliers, 15);
    // The scene is shifted by (5, 3).
    ASSERT_GE(best.polygon.size(), 3U);
    const auto left = std::min_element(best.polygon.begin(), best.polygon.end(),
                                       [](Point a, Point b) { return a.x + a.y < b.x + b.y; });
    EXPECT_NEAR(left->x, 5, 12);
    EXPECT_NEAR(left->y, 3, 12);
    // No score falls, and others agree by chance at most.
    EXPECT_EQ(plain.total, verified.total);
    std::map<std::string, double> before;
    for (const Hit& hit : plain.hits) before[hit.object] = hit.score;
    for (const Hit& hit : verified.hits) {
      EXPECT_GE(hit.score, before[hit.object]) << hit.object;
      EXPECT_LE(hit.score, 1);
      if (hit.object == best.object) continue;
      EXPECT_LE(3 * hit.inliers, best.inliers) << hit.object;
      EXPECT_LT(hit.score, 0.2) << hit.object;
    }
  }
}

TEST_P(EngineVerifyTest, BeyondTheDepthNothingIsVerified) {
  const SearchResult all = Search(1, Verification::kTps);
  const SearchResult one = Search(1, Verification::kTps, 1);
  int verified = 0;
  for (const Hit& hit : one.hits) verified += hit.inliers > 0 ? 1 : 0;
  EXPECT_LE(verified, 1);
  EXPECT_EQ(one.total, all.total);
}

TEST_P(EngineVerifyTest, GroupsPagesAndMinimumScore) {
  Add(OtherViewPng(3), 3, "b");
  SearchOptions options;
  options.verify = Verification::kTps;
  options.group_by = GroupBy::kImage;
  options.limit = 0;
  const auto image = RandomPng(3);
  const SearchResult images = engine_.Search(image, options);
  ASSERT_GE(images.hits.size(), 2U);
  EXPECT_EQ(images.hits[0].image_id, "p3a");
  EXPECT_GT(images.hits[0].score, 0.999);  // the same image
  EXPECT_EQ(images.hits[1].image_id, "p3b");
  options.group_by = GroupBy::kObject;
  const SearchResult objects = engine_.Search(image, options);
  EXPECT_EQ(objects.total + 1, images.total);
  EXPECT_EQ(objects.hits[0].image_id, "p3a");
  EXPECT_NE(objects.hits[1].object, "o3");
  options.offset = 1;
  options.limit = 2;
  const SearchResult page = engine_.Search(image, options);
  ASSERT_EQ(page.hits.size(), 2U);
  EXPECT_EQ(page.hits[0].rank, 2U);
  EXPECT_EQ(page.hits[0].image_id, objects.hits[1].image_id);
  EXPECT_EQ(page.total, objects.total);
  options.offset = 0;
  options.limit = 0;
  options.min_score = objects.hits[0].score - 1e-9;
  EXPECT_EQ(engine_.Search(image, options).total, 1U);
  // By id, with the stored keypoints, which are fewer than a query's; and the same again.
  options.min_score = 0;
  const SearchResult stored = engine_.SearchStored("p3a", options);
  ASSERT_EQ(stored.hits.size(), objects.hits.size());
  EXPECT_EQ(stored.hits[0].image_id, "p3a");
  EXPECT_GT(stored.hits[0].score, 0.999);
  for (const int threads : {2, 3}) {
    options.threads = threads;
    const SearchResult again = engine_.SearchStored("p3a", options);
    ASSERT_EQ(again.hits.size(), stored.hits.size());
    for (std::size_t i = 0; i < stored.hits.size(); ++i) {
      EXPECT_EQ(again.hits[i].image_id, stored.hits[i].image_id);
      EXPECT_EQ(again.hits[i].inliers, stored.hits[i].inliers);
      EXPECT_EQ(again.hits[i].score, stored.hits[i].score);
    }
  }
}

// The left half of one scene beside the right half of another.
Image Halves(std::uint64_t left, std::uint64_t right) {
  Image image = testing::RandomImage(left);
  const Image other = testing::RandomImage(right);
  const auto width = static_cast<std::size_t>(image.width);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    if (2 * (i % width) >= width) image.pixels[i] = other.pixels[i];
  }
  return image;
}

TEST_P(EngineVerifyTest, NoHitStandsBelowOneThatIsLessProbable) {
  for (int i = 1; i <= kObjects; ++i) {  // siblings
    Add(EncodePng(Halves(i, i % kObjects + 1)), kObjects + i, "a");
  }
  std::mt19937_64 random(11);
  const auto draw = [&](int choices) { return static_cast<int>(random() % choices); };
  std::map<bool, int> found;
  for (int search = 0; search < 30; ++search) {
    SCOPED_TRACE(search);
    // Some halves are of no stored object.
    const auto photo =
        testing::NoisyPng(Halves(1 + draw(kObjects + 4), 1 + draw(kObjects + 4)), search);
    SearchOptions options;
    options.group_by = draw(2) == 0 ? GroupBy::kObject : GroupBy::kImage;
    options.verify_depth = std::size_t{0} + draw(4);
    options.max_instances = 1 + draw(3);
    options.limit = 0;
    const SearchResult all = engine_.Search(photo, options);
    for (std::size_t i = 0; i < all.hits.size(); ++i) {
      ASSERT_TRUE(all.hits[i].probability);
      const Hit& before = all.hits[i == 0 ? 0 : i - 1];
      EXPECT_GE(*before.probability, *all.hits[i].probability) << i;
    }
    ASSERT_TRUE(all.found);
    const auto is_found = [&](const Hit& hit) { return *hit.probability >= all.found_from; };
    EXPECT_EQ(*all.found, std::ranges::count_if(all.hits, is_found));
    ++found[*all.found > 0];
  }
  EXPECT_GT(found[true], 5);
  EXPECT_GT(found[false], 5);
}

TEST_P(EngineVerifyTest, AMirroredObjectIsFoundAsMirrored) {
  const Image image = DecodeImage(RandomPng(3)).image;
  SearchOptions options;
  options.verify = Verification::kTps;
  options.explain = true;
  const SearchResult plain = engine_.Search(EncodePng(image), options);
  EXPECT_FALSE(plain.mirrored);
  const SearchResult mirrored = engine_.Search(EncodePng(MirrorImage(image)), options);
  ASSERT_EQ(mirrored.found, 1U);
  EXPECT_TRUE(mirrored.mirrored);
  const Hit& hit = mirrored.hits.front();
  EXPECT_EQ(hit.image_id, "p3a");
  EXPECT_EQ(hit.inliers, plain.hits.front().inliers);
  // In the pixels of what was asked, where right is left.
  const double last = image.width - 1;
  for (const PointPair& pair : hit.explanation.value().inliers) {
    EXPECT_NEAR(pair.query.x, last - pair.reference.x, 3);
    EXPECT_NEAR(pair.query.y, pair.reference.y, 3);
  }
  EXPECT_GT(hit.explanation->mesh.value().points.front().x, last / 2);
  EXPECT_NEAR(hit.polygon.front().x, last - plain.hits.front().polygon.front().x, 3);
  EXPECT_GE(mirrored.timings.extraction.describe_ms, 0);
  options.second_pass = false;
  EXPECT_FALSE(engine_.Search(EncodePng(MirrorImage(image)), options).mirrored);
}

TEST_P(EngineVerifyTest, OnlyTheRegionIsMatched) {
  SearchOptions options;
  options.verify = Verification::kTps;
  options.limit = 1;
  const SearchResult whole = engine_.Search(OtherViewPng(2), options);
  options.region = Region{0, 0, 90, 120};
  const SearchResult part = engine_.Search(OtherViewPng(2), options);
  ASSERT_EQ(part.hits.size(), 1U);
  EXPECT_EQ(part.hits[0].object, "o2");
  EXPECT_GT(part.hits[0].inliers, 0);
  EXPECT_LT(part.hits[0].inliers, whole.hits[0].inliers);
}

TEST_P(EngineVerifyTest, EveryHitIsExplained) {
  SearchOptions options;
  options.limit = 0;
  options.verify_depth = 4;
  const auto image = OtherViewPng(4);
  const SearchResult silent = engine_.Search(image, options);
  options.explain = true;
  const SearchResult result = engine_.Search(image, options);
  EXPECT_EQ(result.query_width, 160);
  EXPECT_EQ(result.query_height, 120);
  ASSERT_EQ(result.hits.size(), silent.hits.size());
  int unseen = 0;
  for (std::size_t i = 0; i < result.hits.size(); ++i) {
    EXPECT_FALSE(silent.hits[i].explanation);
    EXPECT_EQ(result.hits[i].score, silent.hits[i].score);
    ASSERT_TRUE(result.hits[i].explanation);
    const Explanation& e = *result.hits[i].explanation;
    EXPECT_EQ(e.verified, e.failure.empty());
    EXPECT_EQ(e.verified, e.mesh.has_value());
    EXPECT_EQ(static_cast<int>(e.inliers.size()), result.hits[i].inliers);
    EXPECT_LE(result.hits[i].score,
              LiftScore(e.ranking_score, Evidence(e.independent_inliers)) + 1e-12);
    EXPECT_GE(result.hits[i].score, e.ranking_score);
    EXPECT_LE(e.independent_inliers, result.hits[i].inliers);
    unseen += e.reference_width == 0 ? 1 : 0;
  }
  EXPECT_EQ(unseen, kObjects - 4);
  const Explanation& best = *result.hits[0].explanation;
  ASSERT_TRUE(best.verified);
  EXPECT_GE(best.matches, result.hits[0].inliers);
  EXPECT_DOUBLE_EQ(best.inlier_fraction, static_cast<double>(best.inliers.size()) / best.matches);
  EXPECT_EQ(best.reference_width, 160);
  // The scene is shifted by (5, 3): of the image in the collection, seen in the query.
  for (const PointPair& pair : best.inliers) {
    EXPECT_NEAR(pair.query.x - pair.reference.x, 5, 3);
    EXPECT_NEAR(pair.query.y - pair.reference.y, 3, 3);
  }
  const Mesh& mesh = *best.mesh;
  const int row = mesh.rows / 2;
  const int column = mesh.columns / 2;
  const Vec2 from = mesh.reference_point(column, row);
  const Vec2 to = mesh.points[static_cast<std::size_t>(row * mesh.columns + column)];
  EXPECT_NEAR(to.x - from.x, 5, 1.5);
  EXPECT_NEAR(to.y - from.y, 3, 1.5);

  options.verify = Verification::kNone;
  for (const Hit& hit : engine_.Search(image, options).hits) {
    EXPECT_FALSE(hit.explanation->verified);
    EXPECT_EQ(hit.explanation->ranking_score, hit.score);
    EXPECT_EQ(hit.explanation->failure, "This search does not use verification.");
  }
}

INSTANTIATE_TEST_SUITE_P(Descriptors, EngineVerifyTest, ::testing::Values("rootsift", "orb"));

}  // namespace
}  // namespace pliant
