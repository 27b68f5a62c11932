// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A place of the query shows one of the objects that agree with it.
#include "index/verify/suppression.h"

#include <cmath>
#include <limits>
#include <string>

#include <gtest/gtest.h>

#include "index/verify/judgement.h"

namespace pliant {
namespace {

// Keypoints 0..99 lie in one place, 100..199 in another one.
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

// An instance at the keypoints first .. first + count - 1, whose outline is the whole place unless
// `width` says how much of it.
void See(VerifiedImage* image, std::uint32_t first, std::uint32_t count, float distance,
         double width = 100) {
  const double x = first % 100 - 0.5;
  const double y = first < 100 ? 0 : 500;
  const double left = width < 100 ? x : -0.5;
  image->instances.push_back(
      {.inliers = static_cast<int>(count),
       .independent = static_cast<double>(count),
       .polygon = {{left, y - 9}, {left + width, y - 9}, {left + width, y + 9}, {left, y + 9}}});
  image->likeness.push_back(std::numeric_limits<double>::infinity());
  for (std::uint32_t i = 0; i < count; ++i) image->matches.push_back({first + i, distance});
}

// With so much evidence that it has this score.
VerifiedImage Scored(const std::string& id, std::int64_t object, double score) {
  VerifiedImage image;
  image.image = {{1, id, 1}, object, score};
  image.ranking_score = kVerify.most_of_ranking;
  const double lift = score / (1 - score) * (1 - kVerify.most_of_ranking) / kVerify.most_of_ranking;
  image.evidence = std::pow(lift, 1 / kVerify.power) - 1;
  return image;
}

// The probability of such an image without rivals.
double Alone(double score) { return Rounded(30 * score / (30 * score + 1 - score)); }

VerifiedImage Seen(std::int64_t object, double score, std::uint32_t first, std::uint32_t count,
                   float distance, double width = 100) {
  VerifiedImage image = Scored("image", object, score);
  See(&image, first, count, distance, width);
  return image;
}

double Odds(int inliers, double share) {
  const double p = Probability(kVerify.most_of_ranking, Evidence(inliers) * std::sqrt(share));
  return p / (1 - p);
}

TEST(SuppressNonMaxima, ObjectsAtOnePlaceShareTheProbability) {
  std::vector<VerifiedImage> images = {Seen(1, 0.99, 0, 50, 0.3F), Seen(2, 0.9, 10, 40, 0.5F)};
  See(&images[1], 60, 5, 0.5F);  // what only this one has, where the other one is
  images[1].matches[0].distance = 0.2F;
  SuppressNonMaxima(Query(), &images);
  const double ratio = Odds(40, 1.0 / 40) / Odds(50, 49.0 / 50);
  EXPECT_NEAR(images[0].probability, 0.9997 / (1 + std::pow(ratio, 3)), 0.011);
  EXPECT_GT(images[0].probability, 0.9);
  EXPECT_LT(images[1].probability, 0.1);
  EXPECT_DOUBLE_EQ(images[1].image.score, 0.9) << "the score stays";
  EXPECT_EQ(images[1].instances.front().inliers, 40) << "where it was seen is told all the same";
}

TEST(SuppressNonMaxima, OfTwoThatHardlyDifferNeitherIsSure) {
  std::vector<VerifiedImage> images = {Seen(1, 0.99, 0, 50, 0.3F), Seen(2, 0.99, 0, 50, 0.3F)};
  for (std::size_t i = 0; i < 24; ++i) images[0].matches[i].distance = 0.2F;
  for (std::size_t i = 24; i < 50; ++i) images[1].matches[i].distance = 0.2F;
  SuppressNonMaxima(Query(), &images);
  EXPECT_NEAR(images[0].probability, 0.4, 0.05);
  EXPECT_NEAR(images[1].probability, 0.6, 0.05);
}

TEST(SuppressNonMaxima, AnObjectsImagesAreOneRival) {
  std::vector<VerifiedImage> images = {Seen(1, 0.99, 0, 50, 0.3F), Seen(2, 0.9, 0, 40, 0.2F)};
  std::vector<VerifiedImage> more = images;
  for (int i = 0; i < 5; ++i) more.push_back(more[1]);
  SuppressNonMaxima(Query(), &images);
  SuppressNonMaxima(Query(), &more);
  EXPECT_DOUBLE_EQ(more[0].probability, images[0].probability);
  EXPECT_LT(images[0].probability, 0.5);
}

TEST(SuppressNonMaxima, ARivalThatIsSureElsewhereIsNoneHere) {
  std::vector<VerifiedImage> images = {Seen(1, 0.9, 0, 40, 0.3F), Seen(2, 0.999, 100, 90, 0.2F)};
  See(&images[1], 0, 12, 0.5F);
  SuppressNonMaxima(Query(), &images);
  EXPECT_GT(images[0].probability, 0.9);
  EXPECT_DOUBLE_EQ(images[1].probability, Alone(0.999));
}

TEST(SuppressNonMaxima, SiblingsSideBySideAreEachInTheirPlace) {
  // Each is seen in both places: the second one first where the first one is.
  std::vector<VerifiedImage> images = {Seen(1, 0.99, 0, 50, 0.2F), Seen(2, 0.99, 0, 45, 0.5F)};
  See(&images[0], 100, 40, 0.5F);
  See(&images[1], 100, 42, 0.2F);
  images[1].explanations.resize(2);
  images[1].explanations[1].matches = 42;
  SuppressNonMaxima(Query(), &images);
  ASSERT_EQ(images[0].instances.size(), 1U);
  EXPECT_EQ(images[0].instances.front().inliers, 50);
  ASSERT_EQ(images[1].instances.size(), 1U);
  EXPECT_EQ(images[1].instances.front().inliers, 42);
  ASSERT_EQ(images[1].explanations.size(), 1U);
  EXPECT_EQ(images[1].explanations.front().matches, 42) << "it is explained where it is";
  for (const VerifiedImage& image : images) EXPECT_GT(image.probability, 0.9);
}

TEST(SuppressNonMaxima, InPlacesOfTheirOwnAllAreFound) {
  std::vector<VerifiedImage> images = {Seen(1, 0.99, 0, 50, 0.3F), Seen(2, 0.9, 100, 40, 0.5F)};
  See(&images[0], 100, 30, 0.6F);  // more alike to the other one
  See(&images[1], 0, 45, 0.4F);
  SuppressNonMaxima(Query(), &images);
  EXPECT_DOUBLE_EQ(images[0].probability, Alone(0.99));
  EXPECT_DOUBLE_EQ(images[1].probability, Alone(0.9));
  for (const VerifiedImage& image : images) {
    ASSERT_EQ(image.instances.size(), 1U) << "what they were taken for elsewhere is gone";
  }
  EXPECT_EQ(images[0].instances.front().inliers, 50);
  EXPECT_EQ(images[1].instances.front().inliers, 40);
}

TEST(SuppressNonMaxima, APartOfAThingIsNoRival) {
  // A label, and the bottle that it is on.
  std::vector<VerifiedImage> images = {Seen(1, 0.99, 0, 90, 0.3F), Seen(2, 0.9, 0, 20, 0.4F, 25)};
  SuppressNonMaxima(Query(), &images);
  EXPECT_DOUBLE_EQ(images[1].probability, Alone(0.9));
}

TEST(SuppressNonMaxima, WhatLooksLikeASiblingIsLessProbableWhereThereAreSiblings) {
  std::vector<VerifiedImage> alone = {Seen(1, 0.99, 0, 50, 0.3F)};
  alone[0].likeness = {0};
  std::vector<VerifiedImage> among = alone;
  among.push_back(Seen(2, 0.003, 0, 20, 0.5F));
  SuppressNonMaxima(Query(), &alone);
  SuppressNonMaxima(Query(), &among);
  EXPECT_GT(alone[0].probability, 0.95) << "crumpled";
  EXPECT_NEAR(among[0].probability, 0.53, 0.01);
}

TEST(SuppressNonMaxima, OfSiblingsTheOneThatLooksRightWins) {
  // As many inliers, but for one match each.
  std::vector<VerifiedImage> images = {Seen(1, 0.99, 0, 50, 0.3F), Seen(2, 0.99, 0, 49, 0.3F)};
  images[0].likeness = {-0.9};
  SuppressNonMaxima(Query(), &images);
  EXPECT_LT(images[0].probability, 0.1);
  EXPECT_GT(images[1].probability, 0.9);
}

TEST(SuppressNonMaxima, CopiesUnderTwoNamesAreBothFound) {
  std::vector<VerifiedImage> images = {Seen(1, 0.99, 0, 50, 0.3F), Seen(2, 0.99, 0, 50, 0.3F)};
  SuppressNonMaxima(Query(), &images);
  EXPECT_DOUBLE_EQ(images[0].probability, Alone(0.99));
  EXPECT_DOUBLE_EQ(images[1].probability, Alone(0.99));
}

TEST(SuppressNonMaxima, ImagesOfOneObjectAndUnnamedOnesMayShowTheSame) {
  for (const std::int64_t object : {0, 1}) {
    std::vector<VerifiedImage> images = {Seen(object, 0.99, 0, 50, 0.3F),
                                         Seen(object, 0.9, 0, 40, 0.5F)};
    SuppressNonMaxima(Query(), &images);
    EXPECT_DOUBLE_EQ(images[1].probability, Alone(0.9)) << object;
  }
}

TEST(SuppressNonMaxima, AnImageWithoutEvidenceDoesNotComeBeforeASibling) {
  std::vector<VerifiedImage> images = {Seen(1, 0.99, 0, 50, 0.3F), Scored("b", 2, 0.002)};
  images[0].likeness = {-6};
  images[1].evidence = 0;
  SuppressNonMaxima(Query(), &images);
  EXPECT_LT(images[0].probability, 0.05);
  EXPECT_LT(images[1].probability, images[0].probability);
}

TEST(SuppressNonMaxima, WithoutInstancesThereIsNothingToSettle) {
  std::vector<VerifiedImage> images(2);
  images[0] = Scored("a", 1, 0.9);
  SuppressNonMaxima(Query(), &images);
  EXPECT_DOUBLE_EQ(images[0].probability, Alone(0.9));
  SuppressNonMaxima(Query(), &(images = {}));
}

}  // namespace
}  // namespace pliant
