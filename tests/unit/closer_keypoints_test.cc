// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/closer_keypoints.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <gtest/gtest.h>

#include "descriptor/features/descriptor.h"
#include "descriptor/features/faint_keypoints.h"
#include "descriptor/image/cv_image.h"
#include "tests/unit/image_files.h"

namespace pliant {
namespace {

Image Noise(int width, int height, std::uint64_t seed) {
  return CopyFromMat(testing::NoiseImage(width, height, seed));
}

// Of all parts, in pixels of the original.
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

TEST(CloserKeypoints, ACloserLookIsThreeTimesAsCloseButNotBeyondOneAndAHalfTimesTheLimit) {
  EXPECT_EQ(CloserSide(380, 1024), 1140);
  EXPECT_EQ(CloserSide(640, 1024), 1536);
  EXPECT_EQ(CloserSide(1024, 1024), 1536);
  EXPECT_EQ(CloserSide(4000, 1024), 1536);
  EXPECT_EQ(CloserSide(4000, 2048), 3072);
  EXPECT_EQ(CloserSide(100, 64), 96);
  EXPECT_EQ(CloserSide(380, 0), 1140);
  EXPECT_EQ(CloserSide(4000, 0), std::nullopt) << "every pixel was looked at";
  EXPECT_EQ(CloserSide(1400, 0), std::nullopt);
}

TEST(CloserKeypoints, StripsHaveTheKeypointsOfTheWholeImage) {
  const Image image = Noise(900, 1500, 1);  // three strips
  const KeypointOptions options = {.max_keypoints = kMaxKeypoints};
  const auto parts = DetectCloser(image, 1, {}, 1, options);
  ASSERT_EQ(parts.size(), 3U);
  for (const EnlargedKeypoints& part : parts) {
    EXPECT_EQ(part.image.width, 900);
    EXPECT_EQ(part.image.height, parts[0].image.height);
    EXPECT_LT(part.image.height, 750);
    EXPECT_GT(part.inside.size(), 500U);
  }
  const auto whole = DetectFaintKeypoints(image, options);
  const auto placed = Placed(parts);
  ASSERT_EQ(whole.size(), 4096U);
  EXPECT_LE(placed.size(), 4096U);
  EXPECT_GT(placed.size(), 4000U);
  const auto found =
      std::count_if(whole.begin(), whole.end(), [&](const Keypoint& k) { return Has(placed, k); });
  EXPECT_GT(found, 4096 * 97 / 100);
}

TEST(CloserKeypoints, ThoseThatAreKnownAreLeftOut) {
  const Image image = Noise(600, 400, 2);
  const KeypointOptions options = {.max_keypoints = 1000};
  const auto first = Placed(DetectCloser(image, 1, {}, 1.5, options));
  ASSERT_GT(first.size(), 500U);
  const std::vector<Keypoint> half(first.begin(), first.begin() + 300);
  const auto rest = Placed(DetectCloser(image, 1, half, 1.5, options));
  EXPECT_LE(rest.size(), first.size() - half.size());
  EXPECT_GT(rest.size(), first.size() / 3);
  EXPECT_TRUE(Placed(DetectCloser(image, 1, first, 1.5, options)).empty());
}

// Decoded at a part of its size, described enlarged: places are the original's.
TEST(CloserKeypoints, PlacesAreInPixelsOfTheOriginal) {
  const Image image = Noise(400, 300, 3);
  const Image half = ResizeImage(image, 200, 150);
  const KeypointOptions options = {.max_keypoints = 300};
  const auto placed = Placed(DetectCloser(half, 0.5, {}, 2, options));
  const auto in_half = DetectFaintKeypoints(half, options);
  ASSERT_GT(in_half.size(), 100U);
  int found = 0;
  for (Keypoint k : in_half) {
    k.x = (k.x + 0.5F) * 2 - 0.5F;
    k.y = (k.y + 0.5F) * 2 - 0.5F;
    if (std::any_of(placed.begin(), placed.end(), [&](const Keypoint& other) {
          return std::hypot(other.x - k.x, other.y - k.y) < 1;
        })) {
      ++found;
    }
  }
  EXPECT_GT(found, static_cast<int>(in_half.size()) / 2);
}

TEST(LookCloser, AddsToWhatIsKnown) {
  const auto bytes = testing::EncodeAs(testing::NoiseImage(300, 200, 4), ".png");
  const FeatureExtractor extractor = FeatureExtractor(MakeDescriptor("rootsift"), {})
                                         .WithEnlargeBelow(std::numeric_limits<int>::max());
  const Features known = extractor.Extract(bytes, 1);
  ExtractionTimings timings;
  const auto closer = extractor.LookCloser(bytes, known, {}, 1, &timings);
  ASSERT_TRUE(closer);
  EXPECT_GT(closer->keypoints.size(), known.keypoints.size());
  EXPECT_LE(closer->keypoints.size(), known.keypoints.size() + 4096);
  EXPECT_EQ(closer->descriptors.rows, closer->keypoints.size());
  EXPECT_TRUE(
      std::equal(known.keypoints.begin(), known.keypoints.end(), closer->keypoints.begin()));
  EXPECT_TRUE(std::equal(known.descriptors.floats.begin(), known.descriptors.floats.end(),
                         closer->descriptors.floats.begin()));
  EXPECT_EQ(closer->width, 300);
  EXPECT_EQ(closer->height, 200);
  EXPECT_EQ(closer->colours, known.colours);
  EXPECT_GT(timings.detect_ms, 0);
  for (const Keypoint& k : closer->keypoints) {
    EXPECT_TRUE(k.x > -1 && k.x < 300 && k.y > -1 && k.y < 200);
  }
  // The paper's way of describing images has no such look.
  const FeatureExtractor plain(MakeDescriptor("rootsift"), {});
  EXPECT_FALSE(plain.LookCloser(bytes, plain.Extract(bytes, 1), {}, 1));
}

TEST(LookCloser, LargeImagesAreLookedAtInMoreOfTheirPixels) {
  const auto bytes = testing::EncodeAs(testing::NoiseImage(1600, 1200, 5), ".png");
  ExtractionOptions options;
  options.keypoints.max_keypoints = 200;
  const FeatureExtractor extractor = FeatureExtractor(MakeDescriptor("orb"), options)
                                         .WithEnlargeBelow(std::numeric_limits<int>::max());
  const Features known = extractor.Extract(bytes, 1);
  const auto closer = extractor.LookCloser(bytes, known, {}, 1);
  ASSERT_TRUE(closer);
  EXPECT_GT(closer->keypoints.size(), known.keypoints.size() + 400);
  EXPECT_LE(closer->keypoints.size(), known.keypoints.size() + 800);
  float right = 0;
  for (const Keypoint& k : closer->keypoints) right = std::max(right, k.x);
  EXPECT_GT(right, 1500);
}

}  // namespace
}  // namespace pliant
