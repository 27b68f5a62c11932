// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/keypoints.h"

#include <algorithm>
#include <set>
#include <tuple>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "descriptor/image/cv_image.h"
#include "tests/unit/image_files.h"

namespace pliant {
namespace {

Image Noise(int width, int height, std::uint64_t seed) {
  return CopyFromMat(testing::NoiseImage(width, height, seed));
}

TEST(DetectKeypoints, StrongestFirstAndAtMostN) {
  const Image image = Noise(320, 240, 1);
  const auto all = DetectKeypoints(image, {.max_keypoints = 4096});
  ASSERT_GT(all.size(), 200U);
  EXPECT_TRUE(std::is_sorted(all.begin(), all.end(), [](const Keypoint& a, const Keypoint& b) {
    return a.response > b.response;
  }));
  const auto few = DetectKeypoints(image, {.max_keypoints = 50});
  ASSERT_EQ(few.size(), 50U);
  EXPECT_TRUE(std::equal(few.begin(), few.end(), all.begin()));
}

TEST(DetectKeypoints, OneAPlaceUnlessRepeatsAreWanted) {
  const Image image = Noise(320, 240, 2);
  const auto places = [](const std::vector<Keypoint>& keypoints) {
    std::set<std::tuple<float, float, float>> set;
    for (const Keypoint& k : keypoints) set.emplace(k.x, k.y, k.size);
    return set.size();
  };
  const auto once = DetectKeypoints(image, {.max_keypoints = 4096});
  EXPECT_EQ(places(once), once.size());
  const auto repeated =
      DetectKeypoints(image, {.max_keypoints = 4096, .keep_repeated_orientations = true});
  EXPECT_EQ(places(repeated), once.size());
  EXPECT_GT(repeated.size(), once.size());
}

TEST(DetectKeypoints, IsDeterministic) {
  const Image image = Noise(300, 200, 3);
  EXPECT_EQ(DetectKeypoints(image), DetectKeypoints(image));
}

TEST(DetectKeypoints, FlatAndTinyImagesHaveNone) {
  EXPECT_TRUE(DetectKeypoints({100, 100, 1, std::vector<std::uint8_t>(10'000, 77)}).empty());
  EXPECT_TRUE(DetectKeypoints({1, 1, 1, {5}}).empty());
}

TEST(KeepStrongAndSpread, KeepsTheStrongestAndThoseFarFromThem) {
  // From left to right each is clearly weaker than the one before; the last two lie apart.
  std::vector<Keypoint> keypoints;
  for (const float x : {0.0F, 1.0F, 2.0F, 3.0F, 4.0F, 500.0F, 900.0F}) {
    const float response = keypoints.empty() ? 1 : 0.8F * keypoints.back().response;
    keypoints.push_back({.x = x, .response = response});
  }
  const auto all = keypoints;
  KeepStrongAndSpread(4, &keypoints);
  EXPECT_EQ(keypoints, (std::vector<Keypoint>{all[0], all[1], all[5], all[6]}));
  KeepStrongAndSpread(4, &keypoints);
  EXPECT_EQ(keypoints.size(), 4U);
  keypoints.clear();
  KeepStrongAndSpread(4, &keypoints);
  EXPECT_TRUE(keypoints.empty());
}

// The image with its contrast divided by `divisor`.
Image Pale(Image image, int divisor) {
  for (std::uint8_t& value : image.pixels) {
    value = static_cast<std::uint8_t>(128 + (value - 128) / divisor);
  }
  return image;
}

TEST(DetectLowContrastKeypoints, FindsWhatIsPaleAndKeepsTheStrongOnesFirst) {
  const Image image = Noise(320, 240, 5);
  const auto strong = DetectKeypoints(image, {.max_keypoints = 4096});
  const auto low_contrast = DetectLowContrastKeypoints(image, {.max_keypoints = 4096});
  EXPECT_GT(low_contrast.size(), strong.size());
  ASSERT_GE(low_contrast.size(), strong.size());
  EXPECT_TRUE(std::equal(strong.begin(), strong.end(), low_contrast.begin()));
  const int most = static_cast<int>(strong.size() / 2);
  EXPECT_EQ(DetectLowContrastKeypoints(image, {.max_keypoints = most}),
            DetectKeypoints(image, {.max_keypoints = most}));

  const Image pale = Pale(image, 6);
  const auto found = DetectKeypoints(pale).size();
  EXPECT_GT(DetectLowContrastKeypoints(pale).size(), 2 * found + 10);
  EXPECT_TRUE(DetectLowContrastKeypoints(Pale(image, 64)).empty()) << "noise of one grey level";
  EXPECT_THROW(DetectLowContrastKeypoints(image, {.max_keypoints = 0}), Error);
}

TEST(ContrastWeights, LowContrastKeypointsCountLessTheLowerTheirContrast) {
  const Image image = Noise(320, 240, 5);
  for (const float weight : ContrastWeights(DetectKeypoints(image, {.max_keypoints = 4096}))) {
    EXPECT_EQ(weight, 1.0F);
  }
  const auto low_contrast =
      ContrastWeights(DetectLowContrastKeypoints(Pale(image, 6), {.max_keypoints = 4096}));
  ASSERT_FALSE(low_contrast.empty());
  EXPECT_TRUE(std::is_sorted(low_contrast.rbegin(), low_contrast.rend())) << "strongest first";
  EXPECT_LT(low_contrast.back(), 0.6F);
  EXPECT_GT(low_contrast.back(), 0.49F) << "half of SIFT's threshold is the least that is detected";
  EXPECT_EQ(ContrastWeights(std::vector<Keypoint>(2)), std::vector<float>(2, 1.0F)) << "unknown";
}

TEST(DetectKeypoints, RefusesBadOptions) {
  const Image image = Noise(64, 64, 4);
  EXPECT_THROW(DetectKeypoints(image, {.max_keypoints = 0}), Error);
  EXPECT_THROW(DetectKeypoints(image, {.max_keypoints = 4097}), Error);
  EXPECT_THROW(DetectKeypoints({4, 4, 3, std::vector<std::uint8_t>(48)}), Error);
  EXPECT_THROW(DetectKeypoints({}), Error);
}

}  // namespace
}  // namespace pliant
