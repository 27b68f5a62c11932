// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/warp/tps_ransac.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

constexpr double kSide = 480;

// A sheet seen turned, shrunk and strongly bent: up to 25 px off any affine map.
Vec2 Bend(Vec2 p) {
  const double x = p.x + 25 * std::sin(p.y / 70);
  const double y = p.y + 18 * std::cos(p.x / 80);
  return {0.55 * x - 0.35 * y + 220, 0.35 * x + 0.6 * y + 30};
}
constexpr double kBendScale = 0.67;

struct Scene {
  std::vector<Correspondence> matches;
  std::vector<char> right;
};

Scene MakeScene(int right, int wrong, double noise_px, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::uniform_real_distribution<double> place(0, kSide);
  std::normal_distribution<double> unit_noise;
  const auto noise = [&](std::mt19937_64& random) { return noise_px * unit_noise(random); };
  std::uniform_real_distribution<double> jitter(0.8, 1.25);
  Scene scene;
  for (int i = 0; i < right + wrong; ++i) {
    Correspondence c;
    c.reference = {place(generator), place(generator)};
    const bool is_right = i < right;
    c.query = is_right ? Bend(c.reference) : Vec2{place(generator), place(generator)};
    if (is_right) c.query = {c.query.x + noise(generator), c.query.y + noise(generator)};
    c.size_ratio = kBendScale * jitter(generator) * (is_right ? 1 : jitter(generator));
    scene.matches.push_back(c);
    scene.right.push_back(static_cast<char>(is_right));
  }
  // In no order that gives the answer away.
  std::vector<std::size_t> order(scene.matches.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::shuffle(order.begin(), order.end(), generator);
  Scene shuffled;
  for (const std::size_t i : order) {
    shuffled.matches.push_back(scene.matches[i]);
    shuffled.right.push_back(scene.right[i]);
  }
  return shuffled;
}

TEST(TpsRansac, FindsAStrongWarpAmongOutliers) {
  for (const int wrong : {0, 100, 200, 400}) {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      SCOPED_TRACE(std::to_string(wrong) + " wrong, seed " + std::to_string(seed));
      const auto scene = MakeScene(200, wrong, 0.7, seed);
      const auto result = TpsRansac(scene.matches);
      ASSERT_EQ(result.failure, TpsRansacFailure::kNone) << ToString(result.failure);
      int right = 0;
      for (const auto i : result.inliers) right += scene.right[i];
      EXPECT_GE(right, 180);
      EXPECT_LE(static_cast<int>(result.inliers.size()) - right, 1 + wrong / 100);
      EXPECT_TRUE(std::is_sorted(result.inliers.begin(), result.inliers.end()));
      double sum = 0;
      for (int k = 0; k < 100; ++k) {
        const Vec2 p{30.0 + 42 * (k % 10), 30.0 + 42 * (k / 10)};
        sum += std::hypot((*result.warp)(p).x - Bend(p).x, (*result.warp)(p).y - Bend(p).y);
      }
      EXPECT_LT(sum / 100, 1.5);
    }
  }
}

TEST(TpsRansac, AFewRightOnesInAPatch) {
  // 15 right ones in a corner of the reference, 60 wrong ones all over.
  auto scene = MakeScene(15, 60, 0.5, 9);
  for (std::size_t i = 0; i < scene.matches.size(); ++i) {
    if (scene.right[i] == 0) continue;
    auto& c = scene.matches[i];
    c.reference = {c.reference.x / 4 + 40, c.reference.y / 4 + 300};
    c.query = Bend(c.reference);
  }
  const auto result = TpsRansac(scene.matches);
  ASSERT_EQ(result.failure, TpsRansacFailure::kNone);
  int right = 0;
  for (const auto i : result.inliers) right += scene.right[i];
  EXPECT_GE(right, 13);
  EXPECT_LE(static_cast<int>(result.inliers.size()) - right, 1);
}

TEST(TpsRansac, ChanceAgreesOnNextToNothing) {
  int most = 0;
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const auto result = TpsRansac(MakeScene(0, 20 + 3 * static_cast<int>(seed), 0, seed).matches);
    most = std::max(most, static_cast<int>(result.inliers.size()));
    found += result.failure == TpsRansacFailure::kNone ? 1 : 0;
    if (result.failure == TpsRansacFailure::kNone) continue;
    EXPECT_TRUE(result.inliers.empty());
    EXPECT_FALSE(result.warp.has_value());
  }
  EXPECT_LE(most, 7);
  EXPECT_LE(found, 6);
}

TEST(TpsRansac, SameForTheSameSeed) {
  const auto scene = MakeScene(40, 160, 1, 3);
  const auto a = TpsRansac(scene.matches, {.seed = 5});
  const auto b = TpsRansac(scene.matches, {.seed = 5});
  EXPECT_EQ(a.inliers, b.inliers);
  ASSERT_TRUE(a.warp && b.warp);
  EXPECT_EQ((*a.warp)({100, 100}), (*b.warp)({100, 100}));
}

TEST(TpsRansac, MirroredIsNotTheObject) {
  auto scene = MakeScene(150, 0, 0.5, 4);
  for (auto& c : scene.matches) c.query.x = 600 - c.query.x;
  const auto result = TpsRansac(scene.matches);
  EXPECT_NE(result.failure, TpsRansacFailure::kNone);
}

TEST(TpsRansac, WrongSizesAreNotTheObject) {
  auto scene = MakeScene(150, 0, 0.5, 4);
  for (auto& c : scene.matches) c.size_ratio = 5;
  EXPECT_EQ(TpsRansac(scene.matches).failure, TpsRansacFailure::kNoAgreement);
  for (auto& c : scene.matches) c.size_ratio = 0;  // unknown
  EXPECT_EQ(TpsRansac(scene.matches).failure, TpsRansacFailure::kNone);
}

TEST(TpsRansac, ToleranceShrinksWithWhatTheWarpShowsSmaller) {
  const TpsRansacOptions fixed = {.tolerance_px = 4};
  EXPECT_EQ(ToleranceAt(fixed, 0.01), 4);
  const TpsRansacOptions shrinking = {
      .tolerance_px = 4, .reference_tolerance_px = 8, .least_tolerance_px = 1.5};
  EXPECT_EQ(ToleranceAt(shrinking, 1), 4) << "never more";
  EXPECT_EQ(ToleranceAt(shrinking, 0.25), 4);
  EXPECT_DOUBLE_EQ(ToleranceAt(shrinking, 0.09), 2.4);
  EXPECT_EQ(ToleranceAt(shrinking, 0.01), 1.5) << "nor below the least";
  EXPECT_EQ(ToleranceAt(shrinking, -1), 1.5) << "where the warp mirrors";
}

// An object shown at a tenth of its size: 3 px are 6 % of it, within which much agrees by chance.
TEST(TpsRansac, ASmallObjectIsHeldToLess) {
  const auto small = [](double noise_px) {
    Scene scene = MakeScene(60, 0, 0, 4);
    std::mt19937_64 generator(5);
    std::normal_distribution<double> noise(0, noise_px);
    for (Correspondence& c : scene.matches) {
      c.query = {0.15 * c.query.x + noise(generator), 0.15 * c.query.y + noise(generator)};
      c.size_ratio *= 0.15;
    }
    return scene.matches;
  };
  const TpsRansacOptions fixed = {.tolerance_px = 4};
  const TpsRansacOptions shrinking = {
      .tolerance_px = 4, .reference_tolerance_px = 0.02 * kSide, .least_tolerance_px = 0.5};
  EXPECT_GT(TpsRansac(small(0.2), fixed).inliers.size(), 55U);
  EXPECT_GT(TpsRansac(small(0.2), shrinking).inliers.size(), 55U);
  EXPECT_GT(TpsRansac(small(1.5), fixed).inliers.size(), 50U);
  EXPECT_LT(TpsRansac(small(1.5), shrinking).inliers.size(), 30U);
}

TEST(TpsRansac, DegenerateInputFailsWithAReason) {
  EXPECT_EQ(TpsRansac({}).failure, TpsRansacFailure::kTooFew);
  EXPECT_EQ(TpsRansac(MakeScene(4, 0, 0, 1).matches).failure, TpsRansacFailure::kTooFew);
  std::vector<Correspondence> line;
  for (int i = 0; i < 50; ++i) {
    line.push_back({{5.0 * i, 3.0 * i}, {5.0 * i + 10, 3.0 * i}, 1});
  }
  EXPECT_NE(TpsRansac(line).failure, TpsRansacFailure::kNone);
  const std::vector<Correspondence> point(50, Correspondence{{5, 5}, {9, 9}, 1});
  EXPECT_NE(TpsRansac(point).failure, TpsRansacFailure::kNone);
  // All onto one place: no surface looks like that.
  auto scene = MakeScene(50, 0, 0, 1);
  for (auto& c : scene.matches) c.query = {50, 50};
  EXPECT_NE(TpsRansac(scene.matches).failure, TpsRansacFailure::kNone);
}

TEST(TpsRansac, ManyDuplicatesOfARightPlace) {
  auto scene = MakeScene(30, 30, 0.3, 2);
  const auto copy = scene.matches;
  for (int k = 0; k < 3; ++k) {
    scene.matches.insert(scene.matches.end(), copy.begin(), copy.end());
    scene.right.insert(scene.right.end(), scene.right.begin(), scene.right.begin() + 60);
  }
  const auto result = TpsRansac(scene.matches);
  for (const auto i : result.inliers) EXPECT_TRUE(scene.right[i]);
}

TEST(TpsRansac, TheWarpNeverFoldsAtItsInliers) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const auto scene = MakeScene(60, 60, 3, seed);  // as noisy as the tolerance
    const auto result = TpsRansac(scene.matches);
    for (const auto i : result.inliers) {
      const auto [a, b, c, d] = result.warp->Jacobian(scene.matches[i].reference);
      EXPECT_TRUE(IsPlausible(a, b, c, d, TpsRansacOptions{}.max_anisotropy)) << "seed " << seed;
    }
  }
}

TEST(TpsRansac, RefusesBadOptions) {
  const auto matches = MakeScene(20, 0, 0, 1).matches;
  EXPECT_THROW(TpsRansac(matches, {.iterations = 0}), Error);
  EXPECT_THROW(TpsRansac(matches, {.tolerance_px = 0}), Error);
  EXPECT_THROW(TpsRansac(matches, {.reference_tolerance_px = -1}), Error);
  EXPECT_THROW(TpsRansac(matches, {.least_tolerance_px = -1}), Error);
  EXPECT_THROW(TpsRansac(matches, {.regularization = -1}), Error);
  EXPECT_THROW(TpsRansac(matches, {.max_anisotropy = 0.5}), Error);
  EXPECT_THROW(TpsRansac(matches, {.max_size_factor = 0.5}), Error);
  EXPECT_THROW(TpsRansac(matches, {.min_inliers = 3}), Error);
  auto bad = matches;
  bad[3].query.x = std::numeric_limits<double>::infinity();
  EXPECT_THROW(TpsRansac(bad), Error);
}

TEST(LocalAffine, FitsAndRefusesLines) {
  const std::vector<Vec2> reference = {{10, 10}, {50, 12}, {20, 60}, {70, 70}};
  std::vector<Vec2> query;
  for (const Vec2 p : reference) query.push_back({2 * p.x - p.y + 3, p.x + 0.5 * p.y - 4});
  const auto map = FitLocalAffine(reference, query);
  ASSERT_TRUE(map);
  EXPECT_NEAR((*map)({30, 40}).x, 23, 1e-9);
  EXPECT_NEAR((*map)({30, 40}).y, 46, 1e-9);
  EXPECT_NEAR(map->determinant(), 2, 1e-9);
  const std::vector<Vec2> line = {{0, 0}, {10, 0.1}, {20, 0}, {30, 0.1}};
  EXPECT_FALSE(FitLocalAffine(line, query));
  EXPECT_FALSE(FitLocalAffine(std::span(reference).first(2), std::span(query).first(2)));
  EXPECT_TRUE(IsPlausible(1, 0, 0, 1, 2));
  EXPECT_FALSE(IsPlausible(-1, 0, 0, 1, 9));
  EXPECT_FALSE(IsPlausible(3, 0, 0, 1, 2));
  EXPECT_TRUE(IsPlausible(3, 0, 0, 1, 3.01));
  EXPECT_FALSE(IsPlausible(0, 0, 0, 0, 9));
}

}  // namespace
}  // namespace pliant
