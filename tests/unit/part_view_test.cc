// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "descriptor/features/descriptor.h"
#include "descriptor/features/enlarged_keypoints.h"
#include "descriptor/image/cv_image.h"
#include "tests/unit/image_files.h"

namespace pliant {
namespace {

std::vector<std::uint8_t> NoiseFile(int width, int height, std::uint64_t seed) {
  return testing::EncodeAs(testing::NoiseImage(width, height, seed), ".png");
}

FeatureExtractor Extractor(ExtractionOptions options = {}) {
  options.enlarge_below = std::numeric_limits<int>::max();
  return {MakeDescriptor("rootsift"), options};
}

// How many of `few` lie where one of `many` of nearly the same size does.
int Shared(const std::vector<Keypoint>& few, const std::vector<Keypoint>& many) {
  return static_cast<int>(std::count_if(few.begin(), few.end(), [&](const Keypoint& k) {
    return std::any_of(many.begin(), many.end(), [&](const Keypoint& other) {
      return std::hypot(other.x - k.x, other.y - k.y) < 0.5F &&
             std::abs(other.size - k.size) < 0.1F * k.size;
    });
  }));
}

TEST(Region, IsScaledAroundTheImagesCornerAndNotItsFirstPixelsCentre) {
  const Region half = Scaled({-0.5, 9.5, 100, 20}, 0.5);
  EXPECT_DOUBLE_EQ(half.x, -0.5);
  EXPECT_DOUBLE_EQ(half.y, 4.5);
  EXPECT_DOUBLE_EQ(half.width, 50);
  EXPECT_DOUBLE_EQ(half.height, 10);
  const Region seen = SeenFrom(half, 3, 4);
  EXPECT_DOUBLE_EQ(seen.x, -3.5);
  EXPECT_DOUBLE_EQ(seen.y, 0.5);
  EXPECT_TRUE(Contains(half, -0.5, 4.5));
  EXPECT_FALSE(Contains(half, 49.5, 5));
  EXPECT_FALSE(Contains(half, 10, 14.5));
}

TEST(DecodePart, ShowsThePartInItsOwnPixelsWithWhatIsAroundIt) {
  const auto bytes = NoiseFile(2000, 1500, 1);
  const Image whole = DecodeImage(bytes, {.max_side_px = 0}).image;
  const auto view = DecodePart(bytes, {900, 700, 200, 100}, 1024, DecodeImage, {});
  ASSERT_TRUE(view);
  EXPECT_EQ(view->decoded.scale, 1);
  EXPECT_EQ(view->decoded.original_width, 2000);
  EXPECT_EQ(view->decoded.image.width, 328);
  EXPECT_EQ(view->decoded.image.height, 228);
  EXPECT_EQ(view->left, 836);
  EXPECT_EQ(view->top, 636);
  EXPECT_EQ(view->inside.x, 64);
  EXPECT_EQ(view->inside.y, 64);
  EXPECT_EQ(view->inside.width, 200);
  EXPECT_EQ(view->decoded.image.pixels, CutOut(whole, {836, 636, 328, 228}).pixels);
}

TEST(DecodePart, IsNoLargerThanAskedForAndDecodesOnceWhereThatIsEnough) {
  int decoded = 0;
  const ImageDecoder counting = [&](Bytes bytes, const DecodeOptions& options) {
    ++decoded;
    return DecodeImage(bytes, options);
  };
  const auto bytes = NoiseFile(2000, 1000, 2);
  const auto half = DecodePart(bytes, {0, 0, 1000, 1000}, 512, counting, {});
  EXPECT_EQ(decoded, 1) << "the whole image is decoded that large already";
  EXPECT_DOUBLE_EQ(half->decoded.scale, 0.512);
  EXPECT_EQ(half->decoded.image.width, 512 + 64);
  EXPECT_EQ(half->decoded.image.height, 512);
  const auto more = DecodePart(bytes, {0, 0, 1000, 1000}, 800, counting, {.thumbnail_side_px = 64});
  EXPECT_EQ(decoded, 3);
  EXPECT_DOUBLE_EQ(more->decoded.scale, 0.8);
  EXPECT_EQ(more->decoded.thumbnail.width, 64) << "of the whole image";
  // One that is never enlarged.
  const auto small = DecodePart(NoiseFile(100, 80, 3), {10, 10, 20, 20}, 1024, counting, {});
  EXPECT_EQ(decoded, 4);
  EXPECT_EQ(small->decoded.scale, 1);
}

TEST(DecodePart, TheWholeImageHasALimitOfItsOwn) {
  const auto bytes = NoiseFile(6000, 1600, 4);
  const auto view = DecodePart(bytes, {100, 0, 50, 20}, 1024, DecodeImage, {});
  EXPECT_NEAR(view->decoded.scale, 4096.0 / 6000, 1e-3);
  EXPECT_EQ(
      DecodePart(bytes, {100, 0, 50, 20}, 1024, DecodeImage, {.max_side_px = 8000})->decoded.scale,
      1);
}

TEST(DecodePart, CutsOffWhatLiesOutside) {
  const auto bytes = NoiseFile(300, 200, 5);
  for (const Region& outside : {Region{300, 0, 50, 50}, Region{0, -80, 50, 50},
                                Region{-1e300, 0, 5, 5}, Region{1e300, 1e300, 1e300, 1e300}}) {
    EXPECT_FALSE(DecodePart(bytes, outside, 1024, DecodeImage, {}));
    EXPECT_EQ(LongerSide(outside, 300, 200), 0);
    const Features none = Extractor().ExtractPart(bytes, outside, 1);
    EXPECT_TRUE(none.keypoints.empty());
    EXPECT_EQ(none.width, 300);
    EXPECT_EQ(none.height, 200);
    EXPECT_EQ(none.descriptors.rows, 0U);
    EXPECT_EQ(none.model_id, Extractor().descriptor().info().model_id);
  }
  const auto corner = DecodePart(bytes, {250, 150, 1e300, 1e300}, 1024, DecodeImage, {});
  EXPECT_DOUBLE_EQ(LongerSide({250, 150, 1e300, 1e300}, 300, 200), 49.5);
  EXPECT_EQ(corner->decoded.image.width, 300 - 186);
  EXPECT_DOUBLE_EQ(corner->inside.x + corner->inside.width, 300 - 186 - 0.5);
}

TEST(ExtractPart, SeesWhatTheWholeImageSeesThereAndMore) {
  const auto bytes = NoiseFile(800, 600, 6);
  ExtractionOptions options;
  options.keypoints.max_keypoints = 300;
  const Features whole = Extractor(options).Extract(bytes, 1);
  const Region part{300, 200, 160, 120};
  ExtractionTimings timings;
  const Features seen = Extractor(options).ExtractPart(bytes, part, 1, &timings);
  EXPECT_GT(timings.decode_ms, 0);
  EXPECT_EQ(seen.width, 800);
  EXPECT_EQ(seen.height, 600);
  EXPECT_EQ(seen.colours, whole.colours);
  EXPECT_EQ(seen.descriptors.rows, seen.keypoints.size());
  for (const Keypoint& k : seen.keypoints) EXPECT_TRUE(Contains(part, k.x, k.y));
  std::vector<Keypoint> there = whole.keypoints;
  std::erase_if(there, [&](const Keypoint& k) { return !Contains(part, k.x, k.y); });
  ASSERT_GT(there.size(), 10U);
  EXPECT_GT(seen.keypoints.size(), 5 * there.size()) << "others no longer push them out";
  EXPECT_GT(Shared(there, seen.keypoints), static_cast<int>(there.size()) * 9 / 10);
}

TEST(ExtractPart, LargeImagesShowMoreInAPart) {
  const auto bytes = NoiseFile(2400, 1600, 7);
  const Region part{2000, 1200, 300, 300};
  ExtractionOptions options;
  options.decode.max_side_px = 600;
  const Features seen = Extractor(options).ExtractPart(bytes, part, 1);
  options.decode.max_side_px = 0;
  const Features all = Extractor(options).ExtractPart(bytes, part, 1);
  ASSERT_GT(seen.keypoints.size(), 200U);
  EXPECT_GT(Shared(seen.keypoints, all.keypoints), static_cast<int>(seen.keypoints.size()) * 9 / 10)
      << "the part has 300 pixels either way";
}

TEST(ExtractSecondPass, OfAPartAddsKeypointsInIt) {
  const auto bytes = NoiseFile(1600, 1200, 8);
  const Region part{800, 600, 300, 200};
  const FeatureExtractor extractor = Extractor();
  const Features known = extractor.ExtractPart(bytes, part, 1);
  const auto second_pass = extractor.ExtractSecondPass(bytes, known, part, 1);
  ASSERT_TRUE(second_pass);
  EXPECT_GT(second_pass->keypoints.size(), known.keypoints.size());
  EXPECT_EQ(second_pass->descriptors.rows, second_pass->keypoints.size());
  for (const Keypoint& k : second_pass->keypoints) EXPECT_TRUE(Contains(part, k.x, k.y));
  EXPECT_TRUE(
      std::equal(known.keypoints.begin(), known.keypoints.end(), second_pass->keypoints.begin()));
  EXPECT_FALSE(extractor.ExtractSecondPass(bytes, known, Region{5000, 0, 10, 10}, 1));
}

}  // namespace
}  // namespace pliant
