// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/rerank.h"

#include <cmath>

#include <gtest/gtest.h>

namespace pliant {
namespace {

constexpr double kRanked = 0.01;

// A picture whose inliers are the query's key points first .. first + count - 1, its descriptors
// `distance` away.
VerifiedPicture Claiming(std::int64_t object, std::uint32_t first, std::uint32_t count,
                         float distance) {
  VerifiedPicture picture;
  picture.picture = {{1, "picture", 1}, object, kRanked};
  picture.ranking_score = kRanked;
  picture.instances.push_back({.inliers = static_cast<int>(count),
                               .independent = static_cast<double>(count),
                               .polygon = {}});
  for (std::uint32_t i = 0; i < count; ++i) picture.claims.push_back({first + i, distance});
  picture.evidence = Evidence(count);
  picture.picture.score = LiftScore(kRanked, picture.evidence);
  return picture;
}

void Add(VerifiedPicture* picture, std::uint32_t first, std::uint32_t count, float distance) {
  for (std::uint32_t i = 0; i < count; ++i) picture->claims.push_back({first + i, distance});
  picture->instances.front().inliers += static_cast<int>(count);
  picture->instances.front().independent += count;
}

TEST(SettleClaims, OfTwoObjectsWithPartsInCommonTheNearerOneIsFirst) {
  // Both show key points 0..39, where they differ little; the right one differs less at 30..39. The
  // wrong one has more inliers.
  VerifiedPicture right = Claiming(1, 0, 30, 0.50F);
  Add(&right, 30, 10, 0.30F);
  VerifiedPicture wrong = Claiming(2, 0, 30, 0.52F);
  Add(&wrong, 30, 15, 0.60F);
  std::vector<VerifiedPicture> pictures = {wrong, right};
  SettleClaims(&pictures);
  EXPECT_DOUBLE_EQ(pictures[1].evidence, 35.5);                        // all are its own
  EXPECT_DOUBLE_EQ(pictures[0].evidence, 40.5 * std::sqrt(5.0 / 45));  // 40..44 only
  SortByScore(&pictures);
  EXPECT_EQ(pictures.front().picture.object, 1);
}

TEST(SettleClaims, WhatNobodyElseClaimsStays) {
  std::vector<VerifiedPicture> pictures = {Claiming(1, 0, 30, 0.5F), Claiming(2, 30, 20, 0.9F)};
  const double first = pictures[0].picture.score;
  const double second = pictures[1].picture.score;
  SettleClaims(&pictures);
  EXPECT_DOUBLE_EQ(pictures[0].evidence, 25.5);
  EXPECT_DOUBLE_EQ(pictures[1].evidence, 15.5);
  EXPECT_DOUBLE_EQ(pictures[0].picture.score, first);
  EXPECT_DOUBLE_EQ(pictures[1].picture.score, second);
}

TEST(DropHints, FewInliersCountWhereNothingIsDecided) {
  std::vector<VerifiedPicture> undecided = {Claiming(1, 0, 5, 0.5F), Claiming(2, 5, 6, 0.5F)};
  undecided[1].instances.front().independent = 5.25;  // some of the six are in one place
  undecided[1].evidence = Evidence(5.25);
  EXPECT_FALSE(IsDecided(undecided));
  DropHints(&undecided);
  EXPECT_DOUBLE_EQ(undecided[0].evidence, 0.5);
  EXPECT_DOUBLE_EQ(undecided[1].evidence, 0.75);
  EXPECT_GT(undecided[0].picture.score, kRanked);

  std::vector<VerifiedPicture> decided = {Claiming(1, 0, 5, 0.5F), Claiming(2, 5, 6, 0.5F),
                                          Claiming(3, 20, 7, 0.5F)};
  EXPECT_TRUE(IsDecided(decided));
  decided[0].via = "supporter";
  const double second = decided[1].picture.score;
  const double third = decided[2].picture.score;
  DropHints(&decided);
  EXPECT_EQ(decided[0].evidence, 0);
  EXPECT_EQ(decided[0].picture.score, kRanked);
  EXPECT_EQ(decided[0].via, "") << "support that does not count is not named";
  EXPECT_EQ(decided[0].inliers(), 5) << "they are still shown";
  EXPECT_EQ(decided[1].picture.score, second);
  EXPECT_EQ(decided[2].picture.score, third);
}

TEST(SettleClaims, PicturesOfOneObjectShare) {
  std::vector<VerifiedPicture> pictures = {Claiming(1, 0, 30, 0.5F), Claiming(1, 0, 30, 0.7F)};
  SettleClaims(&pictures);
  EXPECT_DOUBLE_EQ(pictures[0].evidence, 25.5);
  EXPECT_DOUBLE_EQ(pictures[1].evidence, 25.5);
}

TEST(SettleClaims, AnotherPictureOfTheObjectWinsForIt) {
  // The second picture of object 1 is nearer than object 2; the first is not, and keeps its claims.
  std::vector<VerifiedPicture> pictures = {Claiming(1, 0, 30, 0.7F), Claiming(1, 0, 30, 0.5F),
                                           Claiming(2, 0, 30, 0.6F)};
  SettleClaims(&pictures);
  EXPECT_DOUBLE_EQ(pictures[0].evidence, 25.5);
  EXPECT_DOUBLE_EQ(pictures[1].evidence, 25.5);
  EXPECT_DOUBLE_EQ(pictures[2].evidence, 0);
  EXPECT_DOUBLE_EQ(pictures[2].picture.score, kRanked);
}

TEST(SettleClaims, UnnamedPicturesMayShowTheSame) {
  std::vector<VerifiedPicture> pictures = {Claiming(0, 0, 30, 0.5F), Claiming(0, 0, 30, 0.7F),
                                           Claiming(3, 0, 30, 0.6F)};
  SettleClaims(&pictures);
  for (const VerifiedPicture& picture : pictures) EXPECT_DOUBLE_EQ(picture.evidence, 25.5);
}

TEST(SettleClaims, EquallyNearOnesShare) {
  std::vector<VerifiedPicture> pictures = {Claiming(1, 0, 30, 0.5F), Claiming(2, 0, 30, 0.5F)};
  SettleClaims(&pictures);
  EXPECT_DOUBLE_EQ(pictures[0].evidence, 25.5);
  EXPECT_DOUBLE_EQ(pictures[1].evidence, 25.5);
}

TEST(SettleClaims, SoDoNearlyEquallyNearOnes) {
  // The same picture, compressed twice.
  std::vector<VerifiedPicture> pictures = {Claiming(1, 0, 30, 0.5F), Claiming(2, 0, 30, 0.51F)};
  SettleClaims(&pictures);
  EXPECT_DOUBLE_EQ(pictures[0].evidence, 25.5);
  EXPECT_DOUBLE_EQ(pictures[1].evidence, 25.5);
}

VerifiedPicture Coloured(VerifiedPicture picture, float factor) {
  for (Claim& claim : picture.claims) claim.colour_factor = factor;
  return picture;
}

TEST(SettleClaims, ColoursDecideWhereBothAreKnown) {
  for (const float distance : {0.0F, 0.6F}) {  // to the last bit the same in grey, too
    std::vector<VerifiedPicture> pictures = {Coloured(Claiming(1, 0, 30, distance), 3),
                                             Coloured(Claiming(2, 0, 30, distance), 2)};
    SettleClaims(&pictures);
    EXPECT_DOUBLE_EQ(pictures[0].evidence, 0);
    EXPECT_DOUBLE_EQ(pictures[1].evidence, 25.5);
  }
}

TEST(SettleClaims, PicturesWithoutColoursAreNeitherPreferredNorPassedOver) {
  for (const float factor : {0.5F, 5.0F}) {
    std::vector<VerifiedPicture> pictures = {Coloured(Claiming(1, 0, 30, 0.5F), factor),
                                             Claiming(2, 0, 30, 0.5F), Claiming(3, 0, 30, 0.6F)};
    SettleClaims(&pictures);
    EXPECT_DOUBLE_EQ(pictures[0].evidence, 25.5);
    EXPECT_DOUBLE_EQ(pictures[1].evidence, 25.5);
    EXPECT_DOUBLE_EQ(pictures[2].evidence, 0);
  }
}

TEST(SettleClaims, TwiceIsOnce) {
  std::vector<VerifiedPicture> pictures = {Claiming(1, 0, 30, 0.5F), Claiming(2, 10, 30, 0.6F)};
  SettleClaims(&pictures);
  const double evidence = pictures[1].evidence;
  SettleClaims(&pictures);
  EXPECT_DOUBLE_EQ(pictures[1].evidence, evidence);
  EXPECT_LT(evidence, 25.5);
}

}  // namespace
}  // namespace pliant
