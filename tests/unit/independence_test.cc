// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "index/verify/verification.h"

namespace pliant {
namespace {

// `places[i]` has so many keypoints, one pixel apart; the places are 100 pixels apart.
Features At(const std::vector<int>& places) {
  Features features;
  for (std::size_t place = 0; place < places.size(); ++place) {
    for (int i = 0; i < places[place]; ++i) {
      Keypoint k;
      k.x = 100.0F * static_cast<float>(place) + static_cast<float>(i);
      features.keypoints.push_back(k);
    }
  }
  return features;
}

// Keypoint i of the query and keypoint i of the reference agree.
double Count(const Features& query, const Features& reference) {
  std::vector<MatchedPair> pairs;
  for (std::uint32_t i = 0; i < query.keypoints.size(); ++i) pairs.push_back({i, i});
  return EffectiveInliers(query, reference, pairs, 10, 10);
}

TEST(EffectiveInliers, CountWhollyWhereTheyStandApart) {
  EXPECT_DOUBLE_EQ(Count(At({1, 1, 1, 1}), At({1, 1, 1, 1})), 4);
  EXPECT_DOUBLE_EQ(Count({}, {}), 0);
}

TEST(EffectiveInliers, CountOnceInOnePlaceOfTheQueryOrOfTheReference) {
  EXPECT_DOUBLE_EQ(Count(At({6}), At({6})), 1);
  EXPECT_DOUBLE_EQ(Count(At({6}), At({1, 1, 1, 1, 1, 1})), 1);
  EXPECT_DOUBLE_EQ(Count(At({1, 1, 1, 1, 1, 1}), At({6})), 1);
  EXPECT_DOUBLE_EQ(Count(At({3, 1, 2}), At({3, 1, 2})), 3);
  // The first three are one place of the query, the last three of the reference.
  EXPECT_DOUBLE_EQ(Count(At({3, 1, 1}), At({1, 1, 3})), 4 / 3.0 + 1 / 5.0);
}

TEST(EffectiveInliers, ThoseAtTheRadiusAreNear) {
  EXPECT_DOUBLE_EQ(Count(At({11}), At({11})), 1);  // 0 .. 10 pixels
  Features features = At({2});
  features.keypoints[1].x = 10.5F;
  EXPECT_DOUBLE_EQ(Count(features, features), 2);
}

}  // namespace
}  // namespace pliant
