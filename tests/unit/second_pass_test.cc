// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <gtest/gtest.h>

#include "descriptor/features/descriptor.h"
#include "descriptor/features/enlarged_keypoints.h"
#include "descriptor/image/cv_image.h"
#include "tests/unit/image_files.h"

namespace pliant {
namespace {

Image Noise(int width, int height, std::uint64_t seed) {
  return CopyFromMat(testing::NoiseImage(width, height, seed));
}

// Of all parts, in pixels of the image.
std::vector<Keypoint> Placed(const std::vector<EnlargedKeypoints>& parts) {
  std::vector<Keypoint> all;
  for (const EnlargedKeypoints& part : parts) {
    EXPECT_EQ(part.inside.size(), part.placed.size());
    all.insert(all.end(), part.placed.begin(), part.placed.end());
  }
  return all;
}

bool Has(const std::vector<Keypoint>& keypoints, const Keypoint& k) {
  return std::any_of(keypoints.begin(), keypoints.end(), [&](const Keypoint& other) {
    return std::abs(other.x - k.x) < 0.1F && std::abs(other.y - k.y) < 0.1F &&
           std::abs(other.size - k.size) < 0.05F * k.size;
  });
}

TEST(SecondPass, IsThreeTimesTheSideButAtMostOneAndAHalfTimesTheLimit) {
  EXPECT_EQ(SecondPassSide(380, 1024), 1140);
  EXPECT_EQ(SecondPassSide(640, 1024), 1536);
  EXPECT_EQ(SecondPassSide(1024, 1024), 1536);
  EXPECT_EQ(SecondPassSide(4000, 1024), 1536);
  EXPECT_EQ(SecondPassSide(4000, 2048), 3072);
  EXPECT_EQ(SecondPassSide(100, 64), 96);
  EXPECT_EQ(SecondPassSide(380, 0), 1140);
  EXPECT_EQ(SecondPassSide(4000, 0), std::nullopt) << "every pixel was looked at";
  EXPECT_EQ(SecondPassSide(1400, 0), std::nullopt);
}

TEST(SecondPass, StripsHaveTheKeypointsOfTheWholeImage) {
  const Image image = Noise(900, 1500, 1);  // three strips
  const KeypointOptions options = {.max_keypoints = kMaxKeypoints};
  const auto parts = DetectAtHighResolution(image, {}, 1, options);
  ASSERT_EQ(parts.size(), 3U);
  for (const EnlargedKeypoints& part : parts) {
    EXPECT_EQ(part.image.width, 900);
    EXPECT_EQ(part.image.height, parts[0].image.height);
    EXPECT_LT(part.image.height, 750);
    EXPECT_GT(part.inside.size(), 500U);
  }
  const auto whole = DetectLowContrastKeypoints(image, options);
  const auto placed = Placed(parts);
  ASSERT_EQ(whole.size(), 4096U);
  EXPECT_LE(placed.size(), 4096U);
  EXPECT_GT(placed.size(), 4000U);
  const auto found =
      std::count_if(whole.begin(), whole.end(), [&](const Keypoint& k) { return Has(placed, k); });
  EXPECT_GT(found, 4096 * 97 / 100);
}

TEST(SecondPass, ThoseThatAreKnownAreLeftOut) {
  const Image image = Noise(600, 400, 2);
  const KeypointOptions options = {.max_keypoints = 1000};
  const auto first = Placed(DetectAtHighResolution(image, {}, 1.5, options));
  ASSERT_GT(first.size(), 500U);
  const std::vector<Keypoint> half(first.begin(), first.begin() + 300);
  const auto rest = Placed(DetectAtHighResolution(image, half, 1.5, options));
  EXPECT_LE(rest.size(), first.size() - half.size());
  EXPECT_GT(rest.size(), first.size() / 3);
  EXPECT_TRUE(Placed(DetectAtHighResolution(image, first, 1.5, options)).empty());
}

TEST(SecondPass, PlacesAreInPixelsOfTheImageThatIsNotEnlarged) {
  const Image image = Noise(400, 300, 3);
  const Image half = ResizeImage(image, 200, 150);
  const KeypointOptions options = {.max_keypoints = 300};
  const auto placed = Placed(DetectAtHighResolution(half, {}, 2, options));
  const auto in_half = DetectLowContrastKeypoints(half, options);
  ASSERT_GT(in_half.size(), 100U);
  int found = 0;
  for (const Keypoint& k : in_half) {
    if (std::any_of(placed.begin(), placed.end(), [&](const Keypoint& other) {
          return std::hypot(other.x - k.x, other.y - k.y) < 0.5F;
        })) {
      ++found;
    }
  }
  EXPECT_GT(found, static_cast<int>(in_half.size()) / 2);
}

TEST(ExtractSecondPass, AddsToWhatIsKnown) {
  const auto bytes = testing::EncodeAs(testing::NoiseImage(300, 200, 4), ".png");
  ExtractionOptions options;
  options.enlarge_below = std::numeric_limits<int>::max();
  const FeatureExtractor extractor(MakeDescriptor("rootsift"), options);
  const Features known = extractor.Extract(bytes, 1);
  ExtractionTimings timings;
  const auto second_pass = extractor.ExtractSecondPass(bytes, known, {}, 1, &timings);
  ASSERT_TRUE(second_pass);
  EXPECT_GT(second_pass->keypoints.size(), known.keypoints.size());
  EXPECT_LE(second_pass->keypoints.size(), known.keypoints.size() + 4096);
  EXPECT_EQ(second_pass->descriptors.rows, second_pass->keypoints.size());
  EXPECT_TRUE(
      std::equal(known.keypoints.begin(), known.keypoints.end(), second_pass->keypoints.begin()));
  EXPECT_TRUE(std::equal(known.descriptors.floats.begin(), known.descriptors.floats.end(),
                         second_pass->descriptors.floats.begin()));
  EXPECT_EQ(second_pass->width, 300);
  EXPECT_EQ(second_pass->height, 200);
  EXPECT_EQ(second_pass->colours, known.colours);
  EXPECT_GT(timings.detect_ms, 0);
  for (const Keypoint& k : second_pass->keypoints) {
    EXPECT_TRUE(k.x > -1 && k.x < 300 && k.y > -1 && k.y < 200);
  }
  // The paper's way of describing images has no such look.
  const FeatureExtractor plain(MakeDescriptor("rootsift"), {});
  EXPECT_FALSE(plain.ExtractSecondPass(bytes, plain.Extract(bytes, 1), {}, 1));
}

TEST(ExtractSecondPass, LargeImagesAreLookedAtInMoreOfTheirPixels) {
  const auto bytes = testing::EncodeAs(testing::NoiseImage(1600, 1200, 5), ".png");
  ExtractionOptions options;
  options.keypoints.max_keypoints = 200;
  options.enlarge_below = std::numeric_limits<int>::max();
  const FeatureExtractor extractor(MakeDescriptor("orb"), options);
  const Features known = extractor.Extract(bytes, 1);
  const auto second_pass = extractor.ExtractSecondPass(bytes, known, {}, 1);
  ASSERT_TRUE(second_pass);
  EXPECT_GT(second_pass->keypoints.size(), known.keypoints.size() + 400);
  EXPECT_LE(second_pass->keypoints.size(), known.keypoints.size() + 800);
  float right = 0;
  for (const Keypoint& k : second_pass->keypoints) right = std::max(right, k.x);
  EXPECT_GT(right, 1500);
}

}  // namespace
}  // namespace pliant
