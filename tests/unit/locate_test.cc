// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Locate on keypoints that are placed by hand.
#include "index/verify/locate.h"

#include <cmath>
#include <functional>
#include <set>

#include <gtest/gtest.h>

#include "descriptor/warp/tps_ransac.h"
#include "index/json/result_json.h"
#include "tests/unit/random_descriptors.h"

namespace pliant {
namespace {

constexpr int kImageWidth = 400;
constexpr int kImageHeight = 300;

// Two images of the same keypoints (same descriptors), placed by `place`.
Location LocatePlaced(const std::function<Vec2(Vec2)>& place,
                      const std::function<Vec2(int)>& reference) {
  constexpr int kPoints = 120;
  Features object;
  object.width = kImageWidth;
  object.height = kImageHeight;
  object.model_id = "test:1";
  object.descriptors = testing::RandomFloats(kPoints, 64, 5);
  for (int i = 0; i < kPoints; ++i) {
    const Vec2 p = reference(i);
    object.keypoints.push_back({static_cast<float>(p.x), static_cast<float>(p.y), 6});
  }
  Features image = object;
  for (Keypoint& k : image.keypoints) {
    const Vec2 q = place({k.x, k.y});
    k.x = static_cast<float>(q.x);
    k.y = static_cast<float>(q.y);
  }
  const LocateOptions options;
  return Locate(Verifier(image, options.verification), image, object, options);
}

Vec2 Anywhere(int i) { return {37.0 * i - std::floor(37.0 * i / 397) * 397, i * 2.4}; }

TEST(Locate, DegenerateArrangementsAreLost) {
  const auto shift = [](Vec2 p) { return Vec2{p.x + 20, p.y + 5}; };
  EXPECT_TRUE(LocatePlaced(shift, Anywhere).found);
  const auto line = [](int i) { return Vec2{3.0 * i, 2.0 * i + 20}; };
  EXPECT_FALSE(LocatePlaced(shift, line).found);
  EXPECT_FALSE(LocatePlaced([](Vec2) { return Vec2{50, 50}; }, Anywhere).found);
  EXPECT_FALSE(LocatePlaced([](Vec2 p) { return Vec2{390 - p.x, p.y}; }, Anywhere).found);
  const auto spot = [](int i) {
    const Vec2 p = Anywhere(i);
    return Vec2{p.x / 12 + 200, p.y / 12 + 100};
  };
  const Location small = LocatePlaced(shift, spot);
  EXPECT_FALSE(small.found);
  EXPECT_EQ(small.reason, LostReason::kSmallPatch);
  EXPECT_GE(small.inliers.size(), 100U) << "what RANSAC says is kept";
}

TEST(Locate, AFoldedHalfDoesNotMakeAWildWarp) {
  // The right half is folded back over the left one.
  const Location found =
      LocatePlaced([](Vec2 p) { return p.x < 240 ? p : Vec2{480 - p.x, p.y}; }, Anywhere);
  if (!found.found) return;
  for (const MatchedPair& pair : found.inliers) {
    const Vec2 p = Anywhere(static_cast<int>(pair.reference));
    const auto [a, b, c, d] = found.warp->Jacobian(p);
    EXPECT_TRUE(IsPlausible(a, b, c, d, TpsRansacOptions{}.max_anisotropy));
  }
  for (const Vec2 p : found.outline) {
    EXPECT_GT(p.x, -kImageWidth);
    EXPECT_LT(p.x, 2 * kImageWidth);
  }
}

TEST(Locate, JsonHasOneForm) {
  const Json found = LocationJson(LocatePlaced([](Vec2 p) { return p; }, Anywhere));
  EXPECT_EQ(found["found"], true);
  EXPECT_TRUE(found["reason"].is_null());
  EXPECT_EQ(found["matches"], 120);
  EXPECT_EQ(found["inliers"], 120);
  EXPECT_EQ(found["inlier_rate"], 1.0);
  EXPECT_EQ(found["mesh"]["columns"], 17);
  EXPECT_GE(found["outline"].size(), 3U);
  const Json lost = LocationJson(LocatePlaced([](Vec2) { return Vec2{5, 5}; }, Anywhere));
  EXPECT_EQ(lost["found"], false);
  EXPECT_TRUE(lost["reason"].is_string());
  EXPECT_TRUE(lost["mesh"].is_null());
  EXPECT_TRUE(lost["outline"].is_null());
}

TEST(Locate, EveryReasonHasAWordAndASentence) {
  std::set<std::string> words;
  for (int i = 0; i <= static_cast<int>(LostReason::kSmallPatch); ++i) {
    words.insert(ToString(static_cast<LostReason>(i)));
    words.insert(Describe(static_cast<LostReason>(i)));
  }
  EXPECT_EQ(words.size(), 16U);
}

}  // namespace
}  // namespace pliant
