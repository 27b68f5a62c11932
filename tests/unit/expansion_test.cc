// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/expansion.h"

#include <algorithm>
#include <map>
#include <random>

#include <gtest/gtest.h>

#include "tests/unit/random_descriptors.h"

namespace pliant {
namespace {

constexpr std::int64_t kNear = 1;   // agrees with the query, and with kFar
constexpr std::int64_t kFar = 2;    // agrees with kNear only
constexpr std::int64_t kOther = 3;  // agrees with nothing
constexpr std::size_t kPoints = 80;
constexpr int kDim = 64;

// Random keypoints in a 640 x 480 image with random descriptors of unit length.
Features MakeImage(std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  Features f;
  f.width = 640;
  f.height = 480;
  f.model_id = "test:1";
  for (std::size_t i = 0; i < kPoints; ++i) {
    Keypoint k;
    k.x = unit(generator) * 639;
    k.y = unit(generator) * 479;
    k.size = 8;
    f.keypoints.push_back(k);
  }
  f.descriptors = testing::RandomFloats(kPoints, kDim, seed);
  return f;
}

// The same surface a little shifted, its descriptors half those of `other`.
Features Between(const Features& one, const Features& other) {
  Features f = one;
  for (Keypoint& k : f.keypoints) k.x += 3;
  for (std::size_t i = 0; i < f.descriptors.floats.size(); ++i) {
    f.descriptors.floats[i] += other.descriptors.floats[i];
  }
  return f;
}

class ExpansionTest : public ::testing::Test {
 protected:
  ExpansionTest() {
    Features near = MakeImage(1);
    Features far = near;  // where the keypoints lie
    far.descriptors = testing::RandomFloats(kPoints, kDim, 7);
    near = Between(near, far);
    images_ = {{kNear, near}, {kFar, far}, {kOther, MakeImage(9)}};
  }

  VerifiedImage Verified(std::int64_t key, double evidence) const {
    VerifiedImage image;
    image.image = {{1, "p" + std::to_string(key), key}, 0, 0.1};
    image.ranking_score = 0.1;
    image.evidence = evidence;
    image.seen = {{0, 0}, {639, 0}, {639, 479}, {0, 479}};
    return image;
  }

  auto Run(const std::vector<VerifiedImage>& images, const ExpansionOptions& options = {}) {
    asked_ = 0;
    return Expand(
        images, options,
        [&](std::int64_t key) -> std::optional<Features> {
          const auto at = images_.find(key);
          if (at == images_.end()) return std::nullopt;
          return at->second;
        },
        [&](const Features& part, std::size_t depth) {
          ++asked_;
          part_ = part.keypoints.size();
          std::vector<RankedImage> ranked;
          for (const std::int64_t key : {kNear, kFar, kOther, std::int64_t{44}}) {
            ranked.push_back({{1, "p" + std::to_string(key), key}, 0, 0.1});
          }
          ranked.resize(std::min(depth, ranked.size()));
          return ranked;
        });
  }

  std::map<std::int64_t, Features> images_;
  int asked_ = 0;
  std::size_t part_ = 0;  // keypoints that asked last
};

TEST_F(ExpansionTest, AChainIsAsStrongAsItsWeakerLinkAndLess) {
  for (const int threads : {1, 3}) {
    const auto supports = Run({Verified(kNear, 12)}, {.threads = threads});
    ASSERT_EQ(supports.size(), 1U);
    ASSERT_TRUE(supports.contains(kFar));  // never looked at before
    EXPECT_EQ(supports.at(kFar).via, "p1");
    EXPECT_DOUBLE_EQ(supports.at(kFar).evidence, 0.4 * 12);  // it has more inliers than that
    EXPECT_EQ(asked_, 1);
  }
}

TEST_F(ExpansionTest, WhatIsSureByItselfNeedsNoSupport) {
  EXPECT_TRUE(Run({Verified(kNear, 12), Verified(kFar, 11)}).empty());
  EXPECT_EQ(Run({Verified(kNear, 12), Verified(kFar, 2)}).size(), 1U);
}

TEST_F(ExpansionTest, OnlyTheSureAskAndOnlySoMany) {
  EXPECT_TRUE(Run({Verified(kNear, 5)}).empty());
  EXPECT_EQ(asked_, 0);
  Run({Verified(kNear, 12), Verified(kFar, 12), Verified(kOther, 12)}, {.sources = 2});
  EXPECT_EQ(asked_, 2);
  EXPECT_TRUE(Run({Verified(kNear, 12)}, {.depth = 1}).empty());  // looks at itself only
}

TEST_F(ExpansionTest, OnlyThePartThatWasSeenAsks) {
  VerifiedImage corner = Verified(kNear, 12);
  corner.seen = {{0, 0}, {200, 0}, {200, 200}, {0, 200}};
  Run({corner});
  const auto& all = images_[kNear].keypoints;
  const auto inside = std::count_if(all.begin(), all.end(), [](const Keypoint& k) {
    return k.x < 230 && k.y < 230;  // the part and what lies around it: 1.3 times
  });
  EXPECT_EQ(part_, static_cast<std::size_t>(inside));
  EXPECT_LT(part_, kPoints);
  corner.seen = {{0, 0}, {2, 0}, {2, 2}};  // nothing to ask with
  EXPECT_TRUE(Run({corner}).empty());
  EXPECT_EQ(asked_, 0);
}

TEST_F(ExpansionTest, AnImageThatWentMeanwhileIsPassedOver) {
  images_.erase(kFar);
  EXPECT_TRUE(Run({Verified(kNear, 12)}).empty());
  images_.erase(kNear);
  EXPECT_TRUE(Run({Verified(kNear, 12)}).empty());
}

}  // namespace
}  // namespace pliant
