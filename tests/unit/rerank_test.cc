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
VerifiedPicture Matching(std::int64_t object, std::uint32_t first, std::uint32_t count,
                         float distance) {
  VerifiedPicture picture;
  picture.picture = {{1, "picture", 1}, object, kRanked};
  picture.ranking_score = kRanked;
  picture.instances.push_back({.inliers = static_cast<int>(count),
                               .independent = static_cast<double>(count),
                               .polygon = {}});
  for (std::uint32_t i = 0; i < count; ++i) picture.matches.push_back({first + i, distance});
  picture.evidence = Evidence(count);
  picture.picture.score = LiftScore(kRanked, picture.evidence);
  return picture;
}

void Add(VerifiedPicture* picture, std::uint32_t first, std::uint32_t count, float distance) {
  for (std::uint32_t i = 0; i < count; ++i) picture->matches.push_back({first + i, distance});
  picture->instances.front().inliers += static_cast<int>(count);
  picture->instances.front().independent += count;
}

TEST(KeepExclusiveMatches, OfTwoObjectsWithPartsInCommonTheNearerOneIsFirst) {
  // Both show key points 0..39, where they differ little; the right one differs less at 30..39. The
  // wrong one has more inliers.
  VerifiedPicture right = Matching(1, 0, 30, 0.50F);
  Add(&right, 30, 10, 0.30F);
  VerifiedPicture wrong = Matching(2, 0, 30, 0.52F);
  Add(&wrong, 30, 15, 0.60F);
  std::vector<VerifiedPicture> pictures = {wrong, right};
  KeepExclusiveMatches(&pictures);
  EXPECT_DOUBLE_EQ(pictures[1].evidence, 35.5);                        // all are its own
  EXPECT_DOUBLE_EQ(pictures[0].evidence, 40.5 * std::sqrt(5.0 / 45));  // 40..44 only
  SortByScore(&pictures);
  EXPECT_EQ(pictures.front().picture.object, 1);
}

TEST(KeepExclusiveMatches, WhatNoOtherObjectMatchesStays) {
  std::vector<VerifiedPicture> pictures = {Matching(1, 0, 30, 0.5F), Matching(2, 30, 20, 0.9F)};
  const double first = pictures[0].picture.score;
  const double second = pictures[1].picture.score;
  KeepExclusiveMatches(&pictures);
  EXPECT_DOUBLE_EQ(pictures[0].evidence, 25.5);
  EXPECT_DOUBLE_EQ(pictures[1].evidence, 15.5);
  EXPECT_DOUBLE_EQ(pictures[0].picture.score, first);
  EXPECT_DOUBLE_EQ(pictures[1].picture.score, second);
}

TEST(DropWeakEvidence, FewInliersCountWhereNothingIsDecided) {
  std::vector<VerifiedPicture> undecided = {Matching(1, 0, 5, 0.5F), Matching(2, 5, 6, 0.5F)};
  undecided[1].instances.front().independent = 5.25;  // some of the six are in one place
  undecided[1].evidence = Evidence(5.25);
  EXPECT_FALSE(IsDecided(undecided));
  DropWeakEvidence(&undecided);
  EXPECT_DOUBLE_EQ(undecided[0].evidence, 0.5);
  EXPECT_DOUBLE_EQ(undecided[1].evidence, 0.75);
  EXPECT_GT(undecided[0].picture.score, kRanked);

  std::vector<VerifiedPicture> decided = {Matching(1, 0, 5, 0.5F), Matching(2, 5, 6, 0.5F),
                                          Matching(3, 20, 7, 0.5F)};
  EXPECT_TRUE(IsDecided(decided));
  decided[0].via = "supporter";
  const double second = decided[1].picture.score;
  const double third = decided[2].picture.score;
  DropWeakEvidence(&decided);
  EXPECT_EQ(decided[0].evidence, 0);
  EXPECT_EQ(decided[0].picture.score, kRanked);
  EXPECT_EQ(decided[0].via, "") << "support that does not count is not named";
  EXPECT_EQ(decided[0].inliers(), 5) << "they are still shown";
  EXPECT_EQ(decided[1].picture.score, second);
  EXPECT_EQ(decided[2].picture.score, third);
}

TEST(KeepExclusiveMatches, PicturesOfOneObjectShare) {
  std::vector<VerifiedPicture> pictures = {Matching(1, 0, 30, 0.5F), Matching(1, 0, 30, 0.7F)};
  KeepExclusiveMatches(&pictures);
  EXPECT_DOUBLE_EQ(pictures[0].evidence, 25.5);
  EXPECT_DOUBLE_EQ(pictures[1].evidence, 25.5);
}

TEST(KeepExclusiveMatches, AnotherPictureOfTheObjectWinsForIt) {
  // The second picture of object 1 is nearer than object 2; the first is not, and keeps its
  // matches.
  std::vector<VerifiedPicture> pictures = {Matching(1, 0, 30, 0.7F), Matching(1, 0, 30, 0.5F),
                                           Matching(2, 0, 30, 0.6F)};
  KeepExclusiveMatches(&pictures);
  EXPECT_DOUBLE_EQ(pictures[0].evidence, 25.5);
  EXPECT_DOUBLE_EQ(pictures[1].evidence, 25.5);
  EXPECT_DOUBLE_EQ(pictures[2].evidence, 0);
  EXPECT_DOUBLE_EQ(pictures[2].picture.score, kRanked);
}

TEST(KeepExclusiveMatches, UnnamedPicturesMayShowTheSame) {
  std::vector<VerifiedPicture> pictures = {Matching(0, 0, 30, 0.5F), Matching(0, 0, 30, 0.7F),
                                           Matching(3, 0, 30, 0.6F)};
  KeepExclusiveMatches(&pictures);
  for (const VerifiedPicture& picture : pictures) EXPECT_DOUBLE_EQ(picture.evidence, 25.5);
}

TEST(KeepExclusiveMatches, EquallyNearOnesShare) {
  std::vector<VerifiedPicture> pictures = {Matching(1, 0, 30, 0.5F), Matching(2, 0, 30, 0.5F)};
  KeepExclusiveMatches(&pictures);
  EXPECT_DOUBLE_EQ(pictures[0].evidence, 25.5);
  EXPECT_DOUBLE_EQ(pictures[1].evidence, 25.5);
}

TEST(KeepExclusiveMatches, SoDoNearlyEquallyNearOnes) {
  // The same picture, compressed twice.
  std::vector<VerifiedPicture> pictures = {Matching(1, 0, 30, 0.5F), Matching(2, 0, 30, 0.51F)};
  KeepExclusiveMatches(&pictures);
  EXPECT_DOUBLE_EQ(pictures[0].evidence, 25.5);
  EXPECT_DOUBLE_EQ(pictures[1].evidence, 25.5);
}

VerifiedPicture Coloured(VerifiedPicture picture, float factor) {
  for (QueryMatch& match : picture.matches) match.colour_factor = factor;
  return picture;
}

TEST(KeepExclusiveMatches, ColoursDecideWhereBothAreKnown) {
  for (const float distance : {0.0F, 0.6F}) {  // to the last bit the same in grey, too
    std::vector<VerifiedPicture> pictures = {Coloured(Matching(1, 0, 30, distance), 3),
                                             Coloured(Matching(2, 0, 30, distance), 2)};
    KeepExclusiveMatches(&pictures);
    EXPECT_DOUBLE_EQ(pictures[0].evidence, 0);
    EXPECT_DOUBLE_EQ(pictures[1].evidence, 25.5);
  }
}

TEST(KeepExclusiveMatches, PicturesWithoutColoursAreNeitherPreferredNorPassedOver) {
  for (const float factor : {0.5F, 5.0F}) {
    std::vector<VerifiedPicture> pictures = {Coloured(Matching(1, 0, 30, 0.5F), factor),
                                             Matching(2, 0, 30, 0.5F), Matching(3, 0, 30, 0.6F)};
    KeepExclusiveMatches(&pictures);
    EXPECT_DOUBLE_EQ(pictures[0].evidence, 25.5);
    EXPECT_DOUBLE_EQ(pictures[1].evidence, 25.5);
    EXPECT_DOUBLE_EQ(pictures[2].evidence, 0);
  }
}

TEST(KeepExclusiveMatches, TwiceIsOnce) {
  std::vector<VerifiedPicture> pictures = {Matching(1, 0, 30, 0.5F), Matching(2, 10, 30, 0.6F)};
  KeepExclusiveMatches(&pictures);
  const double evidence = pictures[1].evidence;
  KeepExclusiveMatches(&pictures);
  EXPECT_DOUBLE_EQ(pictures[1].evidence, evidence);
  EXPECT_LT(evidence, 25.5);
}

}  // namespace
}  // namespace pliant
