// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A place of the query shows one of the objects that agree with it.
#include "index/verify/suppression.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "index/verify/verification.h"

namespace pliant {
namespace {

// Key points 0..99 lie in one place, 100..199 in another one.
Features Query() {
  Features query;
  for (int i = 0; i < 200; ++i) {
    Keypoint k;
    k.x = static_cast<float>(i % 100);
    k.y = i < 100 ? 0.0F : 500.0F;
    query.keypoints.push_back(k);
  }
  return query;
}

// An instance at the key points first .. first + count - 1, whose outline is the whole place unless
// `width` says how much of it.
void See(VerifiedPicture* picture, std::uint32_t first, std::uint32_t count, float distance,
         double width = 100) {
  const double x = first % 100 - 0.5;
  const double y = first < 100 ? 0 : 500;
  const double left = width < 100 ? x : -0.5;
  picture->instances.push_back(
      {.inliers = static_cast<int>(count),
       .independent = static_cast<double>(count),
       .polygon = {{left, y - 9}, {left + width, y - 9}, {left + width, y + 9}, {left, y + 9}}});
  for (std::uint32_t i = 0; i < count; ++i) picture->matches.push_back({first + i, distance});
}

VerifiedPicture Seen(std::int64_t object, double score, std::uint32_t first, std::uint32_t count,
                     float distance, double width = 100) {
  VerifiedPicture picture;
  picture.picture = {{1, "picture", 1}, object, score};
  See(&picture, first, count, distance, width);
  return picture;
}

double Odds(int inliers, double share) {
  const double p = Probability(LiftScore(0, Evidence(inliers) * std::sqrt(share)));
  return p / (1 - p);
}

TEST(SuppressNonMaxima, ObjectsAtOnePlaceShareTheProbability) {
  std::vector<VerifiedPicture> pictures = {Seen(1, 0.99, 0, 50, 0.3F), Seen(2, 0.9, 10, 40, 0.5F)};
  See(&pictures[1], 60, 5, 0.5F);  // what only this one has, where the other one is
  pictures[1].matches[0].distance = 0.2F;
  SuppressNonMaxima(Query(), &pictures);
  const double ratio = Odds(40, 1.0 / 40) / Odds(50, 49.0 / 50);
  EXPECT_NEAR(pictures[0].probability, Probability(0.99) / (1 + std::pow(ratio, 3)), 1e-9);
  EXPECT_GT(pictures[0].probability, 0.9);
  EXPECT_LT(pictures[1].probability, 0.1);
  EXPECT_DOUBLE_EQ(pictures[1].picture.score, 0.9) << "the order stays";
  EXPECT_EQ(pictures[1].instances.front().inliers, 40) << "where it was seen is told all the same";
}

TEST(SuppressNonMaxima, OfTwoThatHardlyDifferNeitherIsSure) {
  std::vector<VerifiedPicture> pictures = {Seen(1, 0.99, 0, 50, 0.3F), Seen(2, 0.99, 0, 50, 0.3F)};
  for (std::size_t i = 0; i < 24; ++i) pictures[0].matches[i].distance = 0.2F;
  for (std::size_t i = 24; i < 50; ++i) pictures[1].matches[i].distance = 0.2F;
  SuppressNonMaxima(Query(), &pictures);
  EXPECT_NEAR(pictures[0].probability, 0.4, 0.05);
  EXPECT_NEAR(pictures[1].probability, 0.6, 0.05);
}

TEST(SuppressNonMaxima, AnObjectsPicturesAreOneRival) {
  std::vector<VerifiedPicture> pictures = {Seen(1, 0.99, 0, 50, 0.3F), Seen(2, 0.9, 0, 40, 0.2F)};
  std::vector<VerifiedPicture> more = pictures;
  for (int i = 0; i < 5; ++i) more.push_back(more[1]);
  SuppressNonMaxima(Query(), &pictures);
  SuppressNonMaxima(Query(), &more);
  EXPECT_DOUBLE_EQ(more[0].probability, pictures[0].probability);
  EXPECT_LT(pictures[0].probability, 0.5);
}

TEST(SuppressNonMaxima, ARivalThatIsSureElsewhereIsNoneHere) {
  std::vector<VerifiedPicture> pictures = {Seen(1, 0.9, 0, 40, 0.3F),
                                           Seen(2, 0.999, 100, 90, 0.2F)};
  See(&pictures[1], 0, 12, 0.5F);
  SuppressNonMaxima(Query(), &pictures);
  EXPECT_GT(pictures[0].probability, 0.9);
  EXPECT_DOUBLE_EQ(pictures[1].probability, Probability(0.999));
}

TEST(SuppressNonMaxima, SiblingsSideBySideAreEachInTheirPlace) {
  // Each is seen in both places: the second one first where the first one is.
  std::vector<VerifiedPicture> pictures = {Seen(1, 0.99, 0, 50, 0.2F), Seen(2, 0.99, 0, 45, 0.5F)};
  See(&pictures[0], 100, 40, 0.5F);
  See(&pictures[1], 100, 42, 0.2F);
  pictures[1].explanations.resize(2);
  pictures[1].explanations[1].matches = 42;
  SuppressNonMaxima(Query(), &pictures);
  ASSERT_EQ(pictures[0].instances.size(), 1U);
  EXPECT_EQ(pictures[0].instances.front().inliers, 50);
  ASSERT_EQ(pictures[1].instances.size(), 1U);
  EXPECT_EQ(pictures[1].instances.front().inliers, 42);
  ASSERT_EQ(pictures[1].explanations.size(), 1U);
  EXPECT_EQ(pictures[1].explanations.front().matches, 42) << "it is explained where it is";
  for (const VerifiedPicture& picture : pictures) EXPECT_GT(picture.probability, 0.9);
}

VerifiedPicture Through(const std::string& source, std::int64_t object, double score) {
  VerifiedPicture picture;
  picture.picture = {{1, "through " + source, 2}, object, score};
  picture.via = source;
  return picture;
}

TEST(SuppressNonMaxima, WhatAgreesThroughAnotherPictureIsNoSurerThanThatIs) {
  std::vector<VerifiedPicture> pictures = {Seen(1, 0.99, 0, 50, 0.3F), Seen(2, 0.95, 0, 40, 0.5F),
                                           Through("beaten", 2, 0.94)};
  pictures[1].picture.ref.id = "beaten";
  SuppressNonMaxima(Query(), &pictures);
  EXPECT_LT(pictures[1].probability, 0.1);
  EXPECT_NEAR(pictures[2].probability, pictures[1].probability, 0.001);
}

TEST(SuppressNonMaxima, WhatAgreesThroughAnotherObjectIsItsRival) {
  std::vector<VerifiedPicture> pictures = {Seen(1, 0.999, 0, 50, 0.3F), Through("picture", 2, 0.94),
                                           Through("picture", 1, 0.94), Through("picture", 0, 0.94),
                                           Through("gone", 2, 0.94)};
  SuppressNonMaxima(Query(), &pictures);
  EXPECT_DOUBLE_EQ(pictures[0].probability, Probability(0.999));
  EXPECT_LT(pictures[1].probability, 0.01);
  for (std::size_t i = 2; i < 5; ++i) {
    EXPECT_DOUBLE_EQ(pictures[i].probability, Probability(0.94)) << i;
  }
}

TEST(SuppressNonMaxima, InPlacesOfTheirOwnAllAreFound) {
  std::vector<VerifiedPicture> pictures = {Seen(1, 0.99, 0, 50, 0.3F), Seen(2, 0.9, 100, 40, 0.5F)};
  See(&pictures[0], 100, 30, 0.6F);  // more alike to the other one
  See(&pictures[1], 0, 45, 0.4F);
  SuppressNonMaxima(Query(), &pictures);
  EXPECT_DOUBLE_EQ(pictures[0].probability, Probability(0.99));
  EXPECT_DOUBLE_EQ(pictures[1].probability, Probability(0.9));
  for (const VerifiedPicture& picture : pictures) {
    ASSERT_EQ(picture.instances.size(), 1U) << "what they were taken for elsewhere is gone";
  }
  EXPECT_EQ(pictures[0].instances.front().inliers, 50);
  EXPECT_EQ(pictures[1].instances.front().inliers, 40);
}

TEST(SuppressNonMaxima, APartOfAThingIsNoRival) {
  // A label, and the bottle that it is on.
  std::vector<VerifiedPicture> pictures = {Seen(1, 0.99, 0, 90, 0.3F),
                                           Seen(2, 0.9, 0, 20, 0.4F, 25)};
  SuppressNonMaxima(Query(), &pictures);
  EXPECT_DOUBLE_EQ(pictures[1].probability, Probability(0.9));
}

TEST(SuppressNonMaxima, CopiesUnderTwoNamesAreBothFound) {
  std::vector<VerifiedPicture> pictures = {Seen(1, 0.99, 0, 50, 0.3F), Seen(2, 0.99, 0, 50, 0.3F)};
  SuppressNonMaxima(Query(), &pictures);
  EXPECT_DOUBLE_EQ(pictures[0].probability, Probability(0.99));
  EXPECT_DOUBLE_EQ(pictures[1].probability, Probability(0.99));
}

TEST(SuppressNonMaxima, PicturesOfOneObjectAndUnnamedOnesMayShowTheSame) {
  for (const std::int64_t object : {0, 1}) {
    std::vector<VerifiedPicture> pictures = {Seen(object, 0.99, 0, 50, 0.3F),
                                             Seen(object, 0.9, 0, 40, 0.5F)};
    SuppressNonMaxima(Query(), &pictures);
    EXPECT_DOUBLE_EQ(pictures[1].probability, Probability(0.9)) << object;
  }
}

TEST(SuppressNonMaxima, WithoutInstancesThereIsNothingToSettle) {
  std::vector<VerifiedPicture> pictures(2);
  pictures[0].picture = {{1, "a", 1}, 1, 0.9};
  SuppressNonMaxima(Query(), &pictures);
  EXPECT_DOUBLE_EQ(pictures[0].probability, Probability(0.9));
  SuppressNonMaxima(Query(), &(pictures = {}));
}

}  // namespace
}  // namespace pliant
