// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/rerank.h"

#include <cmath>

#include <gtest/gtest.h>

namespace pliant {
namespace {

constexpr double kRanked = 0.01;

// An image whose inliers are the query's keypoints first .. first + count - 1, its descriptors
// `distance` away.
VerifiedImage Matching(std::int64_t object, std::uint32_t first, std::uint32_t count,
                       float distance) {
  VerifiedImage image;
  image.image = {{1, "image", 1}, object, kRanked};
  image.ranking_score = kRanked;
  image.instances.push_back({.inliers = static_cast<int>(count),
                             .independent = static_cast<double>(count),
                             .polygon = {}});
  for (std::uint32_t i = 0; i < count; ++i) image.matches.push_back({first + i, distance});
  image.evidence = Evidence(count);
  image.image.score = LiftScore(kRanked, image.evidence);
  return image;
}

void Add(VerifiedImage* image, std::uint32_t first, std::uint32_t count, float distance) {
  for (std::uint32_t i = 0; i < count; ++i) image->matches.push_back({first + i, distance});
  image->instances.front().inliers += static_cast<int>(count);
  image->instances.front().independent += count;
}

TEST(KeepExclusiveMatches, OfTwoObjectsWithPartsInCommonTheNearerOneIsFirst) {
  // Both show keypoints 0..39, where they differ little; the right one differs less at 30..39. The
  // wrong one has more inliers.
  VerifiedImage right = Matching(1, 0, 30, 0.50F);
  Add(&right, 30, 10, 0.30F);
  VerifiedImage wrong = Matching(2, 0, 30, 0.52F);
  Add(&wrong, 30, 15, 0.60F);
  std::vector<VerifiedImage> images = {wrong, right};
  KeepExclusiveMatches(&images);
  EXPECT_DOUBLE_EQ(images[1].evidence, 35.5);                        // all are its own
  EXPECT_DOUBLE_EQ(images[0].evidence, 40.5 * std::sqrt(5.0 / 45));  // 40..44 only
  SortByProbability(&images);
  EXPECT_EQ(images.front().image.object, 1);
}

TEST(KeepExclusiveMatches, WhatNoOtherObjectMatchesStays) {
  std::vector<VerifiedImage> images = {Matching(1, 0, 30, 0.5F), Matching(2, 30, 20, 0.9F)};
  const double first = images[0].image.score;
  const double second = images[1].image.score;
  KeepExclusiveMatches(&images);
  EXPECT_DOUBLE_EQ(images[0].evidence, 25.5);
  EXPECT_DOUBLE_EQ(images[1].evidence, 15.5);
  EXPECT_DOUBLE_EQ(images[0].image.score, first);
  EXPECT_DOUBLE_EQ(images[1].image.score, second);
}

TEST(KeepExclusiveMatches, ImagesOfOneObjectShare) {
  std::vector<VerifiedImage> images = {Matching(1, 0, 30, 0.5F), Matching(1, 0, 30, 0.7F)};
  KeepExclusiveMatches(&images);
  EXPECT_DOUBLE_EQ(images[0].evidence, 25.5);
  EXPECT_DOUBLE_EQ(images[1].evidence, 25.5);
}

TEST(KeepExclusiveMatches, AnotherImageOfTheObjectWinsForIt) {
  // The second image of object 1 is nearer than object 2; the first is not, and keeps its
  // matches.
  std::vector<VerifiedImage> images = {Matching(1, 0, 30, 0.7F), Matching(1, 0, 30, 0.5F),
                                       Matching(2, 0, 30, 0.6F)};
  KeepExclusiveMatches(&images);
  EXPECT_DOUBLE_EQ(images[0].evidence, 25.5);
  EXPECT_DOUBLE_EQ(images[1].evidence, 25.5);
  EXPECT_DOUBLE_EQ(images[2].evidence, 0);
  EXPECT_DOUBLE_EQ(images[2].image.score, kRanked);
}

TEST(KeepExclusiveMatches, UnnamedImagesMayShowTheSame) {
  std::vector<VerifiedImage> images = {Matching(0, 0, 30, 0.5F), Matching(0, 0, 30, 0.7F),
                                       Matching(3, 0, 30, 0.6F)};
  KeepExclusiveMatches(&images);
  for (const VerifiedImage& image : images) EXPECT_DOUBLE_EQ(image.evidence, 25.5);
}

TEST(KeepExclusiveMatches, EquallyNearOnesShare) {
  std::vector<VerifiedImage> images = {Matching(1, 0, 30, 0.5F), Matching(2, 0, 30, 0.5F)};
  KeepExclusiveMatches(&images);
  EXPECT_DOUBLE_EQ(images[0].evidence, 25.5);
  EXPECT_DOUBLE_EQ(images[1].evidence, 25.5);
}

TEST(KeepExclusiveMatches, SoDoNearlyEquallyNearOnes) {
  // The same image, compressed twice.
  std::vector<VerifiedImage> images = {Matching(1, 0, 30, 0.5F), Matching(2, 0, 30, 0.51F)};
  KeepExclusiveMatches(&images);
  EXPECT_DOUBLE_EQ(images[0].evidence, 25.5);
  EXPECT_DOUBLE_EQ(images[1].evidence, 25.5);
}

VerifiedImage Coloured(VerifiedImage image, float factor) {
  for (QueryMatch& match : image.matches) match.colour_factor = factor;
  return image;
}

TEST(KeepExclusiveMatches, ColoursDecideWhereBothAreKnown) {
  for (const float distance : {0.0F, 0.6F}) {  // to the last bit the same in grey, too
    std::vector<VerifiedImage> images = {Coloured(Matching(1, 0, 30, distance), 3),
                                         Coloured(Matching(2, 0, 30, distance), 2)};
    KeepExclusiveMatches(&images);
    EXPECT_DOUBLE_EQ(images[0].evidence, 0);
    EXPECT_DOUBLE_EQ(images[1].evidence, 25.5);
  }
}

TEST(KeepExclusiveMatches, ImagesWithoutColoursAreNeitherPreferredNorPassedOver) {
  for (const float factor : {0.5F, 5.0F}) {
    std::vector<VerifiedImage> images = {Coloured(Matching(1, 0, 30, 0.5F), factor),
                                         Matching(2, 0, 30, 0.5F), Matching(3, 0, 30, 0.6F)};
    KeepExclusiveMatches(&images);
    EXPECT_DOUBLE_EQ(images[0].evidence, 25.5);
    EXPECT_DOUBLE_EQ(images[1].evidence, 25.5);
    EXPECT_DOUBLE_EQ(images[2].evidence, 0);
  }
}

TEST(KeepExclusiveMatches, TwiceIsOnce) {
  std::vector<VerifiedImage> images = {Matching(1, 0, 30, 0.5F), Matching(2, 10, 30, 0.6F)};
  KeepExclusiveMatches(&images);
  const double evidence = images[1].evidence;
  KeepExclusiveMatches(&images);
  EXPECT_DOUBLE_EQ(images[1].evidence, evidence);
  EXPECT_LT(evidence, 25.5);
}

}  // namespace
}  // namespace pliant
