// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What is bent laid flat.
#include "descriptor/warp/unwarp.h"

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "tests/unit/bent_images.h"
#include "tests/unit/tracker_fixture.h"

namespace pliant::testing {
namespace {

TEST(Unwarp, LaysTheBentObjectFlat) {
  const Tracker tracker = MakeTracker();
  const Bend bend{1, 20, {5, 0}};
  const Image frame = BentImage(Template(), bend);
  const Location found = tracker.Find(tracker.Describe(frame));
  ASSERT_TRUE(found.found);
  const auto mean_ssim = [](const Image& a, const std::vector<bool>* known) {
    const std::vector<float> map = SsimMap(a, Template());
    double sum = 0;
    int count = 0;
    for (int y = 30; y < kHeight - 30; ++y) {
      for (int x = 30; x < kWidth - 30; ++x) {
        const auto at = static_cast<std::size_t>(y) * kWidth + x;
        if (known != nullptr && !(*known)[at]) continue;
        sum += map[at];
        ++count;
      }
    }
    return sum / count;
  };
  const UnwarpedImage flat = Unwarp(frame, *found.warp, kWidth, kHeight);
  EXPECT_GT(mean_ssim(flat.image, &flat.known), 0.75);
  EXPECT_LT(mean_ssim(frame, nullptr), 0.3);
  EXPECT_NEAR(mean_ssim(Template(), nullptr), 1, 1e-6);
}

TEST(Unwarp, KnowsWhatItHasNotSeen) {
  const Vec2 from[] = {{0, 0}, {10, 0}, {0, 10}, {10, 10}};
  const Vec2 to[] = {{-5, 0}, {5, 0}, {-5, 10}, {5, 10}};
  const ThinPlateSpline shift = ThinPlateSpline::Fit(from, to);
  const Image frame{20, 12, 3, std::vector<std::uint8_t>(720, 77)};
  const UnwarpedImage flat = Unwarp(frame, shift, 30, 12);
  EXPECT_FALSE(flat.known[4]);
  EXPECT_TRUE(flat.known[6]);
  EXPECT_EQ(flat.image.pixels[6 * 3], 77);
  EXPECT_EQ(flat.image.pixels[4 * 3], 0);
  EXPECT_FALSE(flat.known[26]);
  EXPECT_THROW(Unwarp(Image{}, shift, 5, 5), Error);
  EXPECT_THROW(Unwarp(frame, shift, 0, 5), Error);
  EXPECT_THROW(SsimMap(frame, frame), Error);
}

}  // namespace
}  // namespace pliant::testing
