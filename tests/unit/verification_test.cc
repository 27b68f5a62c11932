// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/verification.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "descriptor/match/distance.h"
#include "index/verify/warp_geometry.h"
#include "tests/unit/random_descriptors.h"

namespace pliant {
namespace {

constexpr int kWidth = 640;
constexpr int kHeight = 480;

Vec2 Bend(Vec2 p) {
  return {0.6 * p.x + 12 * std::sin(p.y / 60) + 100, 0.6 * p.y + 10 * std::cos(p.x / 70) + 60};
}

// An image of random keypoints with random descriptors.
Features MakeImage(std::size_t n, bool binary, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  Features f;
  f.width = kWidth;
  f.height = kHeight;
  f.model_id = "test:1";
  for (std::size_t i = 0; i < n; ++i) {
    Keypoint k;
    k.x = unit(generator) * (kWidth - 1);
    k.y = unit(generator) * (kHeight - 1);
    k.size = 4 + 8 * unit(generator);
    f.keypoints.push_back(k);
  }
  f.descriptors = binary ? testing::RandomBits(n, 32, seed) : testing::RandomFloats(n, 64, seed);
  return f;
}

// The first `shared` keypoints of `reference`, bent, with slightly changed descriptors, among
// those of another image.
Features BentView(const Features& reference, std::size_t shared, std::uint64_t seed) {
  const bool binary = reference.descriptors.kind == DescriptorKind::kBinary;
  Features f = MakeImage(reference.keypoints.size(), binary, seed);
  std::mt19937_64 generator(seed);
  std::normal_distribution<float> noise(0, 0.2F);
  const int dim = reference.descriptors.dim;
  for (std::size_t i = 0; i < shared; ++i) {
    const std::size_t at = f.keypoints.size() - 1 - i;
    const Vec2 q = Bend({reference.keypoints[i].x, reference.keypoints[i].y});
    f.keypoints[at].x = static_cast<float>(q.x);
    f.keypoints[at].y = static_cast<float>(q.y);
    f.keypoints[at].size = reference.keypoints[i].size * 0.6F;
    for (int p = 0; p < dim; ++p) {
      if (binary) {
        f.descriptors.bytes[at * dim + p] = reference.descriptors.bytes[i * dim + p] ^ (p % 9 == 0);
      } else {
        f.descriptors.floats[at * dim + p] =
            reference.descriptors.floats[i * dim + p] + noise(generator);
      }
    }
  }
  return f;
}

class VerificationKinds : public ::testing::TestWithParam<bool> {};

TEST_P(VerificationKinds, FindsTheBentObjectAndItsOutline) {
  const auto reference = MakeImage(400, GetParam(), 1);
  const auto query = BentView(reference, 120, 2);
  const auto result = Verifier(query).Verify(reference);
  ASSERT_TRUE(result.verified()) << ToString(result.failure);
  EXPECT_GE(result.inliers.size(), 110U);
  EXPECT_LE(result.inliers.size(), 122U);
  int wrong = 0;
  for (const auto& pair : result.inliers) {
    wrong += pair.query != query.keypoints.size() - 1 - pair.reference ? 1 : 0;
  }
  EXPECT_LE(wrong, 1);
  EXPECT_GE(result.matches, static_cast<int>(result.inliers.size()));
  EXPECT_NEAR(result.inlier_fraction, static_cast<double>(result.inliers.size()) / result.matches,
              1e-12);
  ASSERT_EQ(result.outline.size(), 32U);
  EXPECT_FALSE(CrossesItself(result.outline));
  const Vec2 corner = Bend({0, 0});
  EXPECT_LT(std::hypot(result.outline[0].x - corner.x, result.outline[0].y - corner.y), 12);
}

TEST_P(VerificationKinds, FindsTheObjectAgainElsewhere) {
  const auto reference = MakeImage(300, GetParam(), 3);
  // A view of it, then the same view once more to the right, among keypoints of neither.
  const auto view = BentView(reference, 150, 4);
  Features query = view;
  query.width = 3 * kWidth;
  const auto again = BentView(reference, 110, 5);
  for (std::size_t i = 0; i < again.keypoints.size(); ++i) {
    query.keypoints.push_back(again.keypoints[i]);
    query.keypoints.back().x += 2 * kWidth;
  }
  query.descriptors.rows += again.descriptors.rows;
  query.descriptors.floats.insert(query.descriptors.floats.end(), again.descriptors.floats.begin(),
                                  again.descriptors.floats.end());
  query.descriptors.bytes.insert(query.descriptors.bytes.end(), again.descriptors.bytes.begin(),
                                 again.descriptors.bytes.end());
  const auto once = Verifier(query).Verify(reference);
  EXPECT_TRUE(once.others.empty());
  const auto result = Verifier(query, {.max_instances = 3}).Verify(reference);
  EXPECT_GE(result.inliers.size(), once.inliers.size()) << "the better one is first";
  ASSERT_EQ(result.others.size(), 1U);
  const auto is_right = [&](const MatchedPair& pair) {
    return query.keypoints[pair.query].x > 1.5 * kWidth;
  };
  const bool first_is_right = is_right(result.inliers[0]);
  for (const MatchedPair& pair : result.inliers) EXPECT_EQ(is_right(pair), first_is_right);
  const FoundInstance& other = result.others[0];
  EXPECT_GE(other.inliers.size(), 80U);
  for (const MatchedPair& pair : other.inliers) EXPECT_NE(is_right(pair), first_is_right);
  for (const Vec2 corner : other.outline) EXPECT_NE(corner.x > 1.5 * kWidth, first_is_right);
  EXPECT_THROW(Verifier(query, {.max_instances = 0}), Error);
}

TEST_P(VerificationKinds, DifferentImagesDoNotAgree) {
  int verified = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const auto query = MakeImage(500, GetParam(), 100 + seed);
    const auto result = Verifier(query, {.max_ratio = 1}).Verify(MakeImage(500, GetParam(), seed));
    EXPECT_LE(result.inliers.size(), 7U);
    verified += result.verified() ? 1 : 0;
  }
  EXPECT_LE(verified, 2);
}

INSTANTIATE_TEST_SUITE_P(Kinds, VerificationKinds, ::testing::Bool(),
                         [](const auto& test) { return test.param ? "binary" : "floats"; });

TEST(Verification, TheImageItself) {
  const auto image = MakeImage(300, false, 5);
  const auto result = Verifier(image).Verify(image);
  EXPECT_EQ(result.inliers.size(), 300U);
  EXPECT_NEAR(result.outline[0].x, 0, 0.01);
  EXPECT_NEAR(result.outline[8].x, kWidth - 1, 0.01);
}

// Shown a twelfth as wide, 50 pixels of a photograph of 640, most inliers lie within the tolerance
// that a large object would have, and still stand apart.
TEST(Verification, InliersOfASmallObjectStandApart) {
  const auto reference = MakeImage(400, false, 1);
  Features query = BentView(reference, 40, 2);
  for (std::size_t i = 0; i < 40; ++i) {
    Keypoint& k = query.keypoints[query.keypoints.size() - 1 - i];
    k.x = 300 + k.x / 8;
    k.y = 200 + k.y / 8;
    k.size /= 8;
  }
  const auto shrinking = Verifier(query).Verify(reference);
  const auto fixed = Verifier(query, {.reference_tolerance = 0}).Verify(reference);
  ASSERT_TRUE(shrinking.verified());
  ASSERT_TRUE(fixed.verified());
  EXPECT_GT(shrinking.inliers.size(), 35U);
  EXPECT_GT(shrinking.effective_inliers, 1.5 * fixed.effective_inliers);
}

// A part of a large photograph: its own size decides, not the photograph's.
TEST(Verification, APartOfALargeImageIsLookedAtAsFinely) {
  const auto reference = MakeImage(400, false, 1);
  const auto query = BentView(reference, 40, 2);
  Features part = query;
  part.width = 20 * kWidth;
  part.height = 20 * kHeight;
  for (Keypoint& k : part.keypoints) {
    k.x += 3000;
    k.y += 2000;
  }
  const auto whole = Verifier(query).Verify(reference);
  const auto in_part = Verifier(part).Verify(reference);
  ASSERT_TRUE(whole.verified());
  ASSERT_TRUE(in_part.verified());
  EXPECT_GT(in_part.effective_inliers, 0.6 * whole.effective_inliers);
}

TEST(Verification, FewOrNoKeypoints) {
  const auto image = MakeImage(100, false, 1);
  Features empty;
  empty.width = kWidth;
  empty.height = kHeight;
  empty.model_id = "test:1";
  EXPECT_FALSE(Verifier(image).Verify(empty).verified());
  EXPECT_FALSE(Verifier(empty).Verify(image).verified());
  EXPECT_FALSE(Verifier(empty).Verify(empty).verified());
  const auto three = MakeImage(3, false, 1);
  const auto result = Verifier(three).Verify(three);
  EXPECT_EQ(result.failure, TpsRansacFailure::kTooFew);
  EXPECT_EQ(result.matches, 3);
}

TEST(Verification, RefusesWhatDoesNotFit) {
  const auto image = MakeImage(20, false, 1);
  auto other = image;
  other.model_id = "test:2";
  EXPECT_THROW(Verifier(image).Verify(other), Error);
  EXPECT_THROW(Verifier(image, {.tolerance = 0}), Error);
  EXPECT_THROW(Verifier(image, {.reference_tolerance = -1}), Error);
  EXPECT_THROW(Verifier(image, {.least_tolerance = -1}), Error);
  EXPECT_THROW(Verifier(image, {.max_ratio = 2}).Verify(image), Error);
  other = image;
  other.keypoints.pop_back();
  EXPECT_THROW(Verifier(image).Verify(other), Error);
  EXPECT_THROW(Verifier{other}, Error);
  other = image;
  other.descriptors.floats[5] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(Verifier(image).Verify(other), Error);
}

TEST(Outline, HullAndCrossing) {
  const auto hull = ConvexHull({{0, 0}, {4, 0}, {4, 4}, {0, 4}, {2, 2}, {2, 0}, {4, 4}});
  ASSERT_EQ(hull.size(), 4U);
  EXPECT_EQ(hull[0], (Vec2{0, 0}));
  EXPECT_EQ(hull[2], (Vec2{4, 4}));
  EXPECT_EQ(ConvexHull({{1, 1}, {1, 1}}).size(), 1U);
  EXPECT_EQ(ConvexHull({{0, 0}, {1, 1}, {2, 2}}).size(), 2U);
  EXPECT_FALSE(CrossesItself(hull));
  EXPECT_TRUE(CrossesItself(std::vector<Vec2>{{0, 0}, {4, 4}, {4, 0}, {0, 4}}));
}

// A grid: each keypoint of the reference has its mutual match in another copy.
TEST(Verification, AllCopiesInAGridAreFound) {
  const auto reference = MakeImage(80, false, 1);
  for (const int columns : {2, 3, 4}) {
    Features query = MakeImage(50, false, 2);
    std::mt19937_64 generator(3);
    std::normal_distribution<float> noise(0, 0.2F);
    query.width = kWidth * columns;
    query.height = kHeight * columns;
    for (int copy = 0; copy < columns * columns; ++copy) {
      Descriptors descriptors = reference.descriptors;
      for (float& value : descriptors.floats) value += noise(generator);
      query.descriptors.Append(descriptors);
      for (Keypoint k : reference.keypoints) {
        k.x = 0.9F * k.x + static_cast<float>(kWidth * (copy % columns));
        k.y = 0.9F * k.y + static_cast<float>(kHeight * (copy / columns));
        k.size *= 0.9F;
        query.keypoints.push_back(k);
      }
    }
    const auto result = Verifier(query, {.max_instances = 20}).Verify(reference);
    ASSERT_TRUE(result.verified()) << columns;
    EXPECT_EQ(result.others.size() + 1, static_cast<std::size_t>(columns * columns));
    EXPECT_GT(result.agreeing, 0.9) << "copies do not contradict each other";
  }
}

// A page of text, a board, knit: every detail is there many times.
TEST(Verification, DistinctnessTellsWhetherTheDetailsResembleEachOther) {
  const auto reference = MakeImage(400, false, 1);
  const auto query = BentView(reference, 100, 2);
  const auto distinct = Verifier(query).Verify(reference);
  ASSERT_TRUE(distinct.verified());
  EXPECT_GT(distinct.distinctness, 1);
  EXPECT_GT(distinct.agreeing, 0.9);

  // The keypoints that the two do not share show one of 20 letters of the reference.
  Features text = query;
  const auto dim = static_cast<std::size_t>(text.descriptors.dim);
  for (std::size_t i = 0; i < 300 * dim; ++i) {
    text.descriptors.floats[i] = reference.descriptors.floats[i % (20 * dim)];
  }
  const auto alike = Verifier(text).Verify(reference);
  ASSERT_TRUE(alike.verified());
  EXPECT_LT(alike.distinctness, 0.1);

  Features fine = query;  // a second pass adds keypoints
  for (std::size_t i = 0; i < 300; ++i) fine.keypoints.push_back(text.keypoints[i]);
  std::vector<std::uint32_t> added(300);
  std::iota(added.begin(), added.end(), 0U);
  fine.descriptors.Append(SelectRows(text.descriptors, added));
  const auto usual = Verifier(fine, {.usual_keypoints = query.keypoints.size()}).Verify(reference);
  ASSERT_TRUE(usual.verified());
  EXPECT_GT(usual.distinctness, 1);
}

}  // namespace
}  // namespace pliant
