// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The tracker on frames bent by a known map, and on what cannot be tracked.
#include <algorithm>
#include <cmath>
#include <memory>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "tests/unit/tracker_fixture.h"

namespace pliant::testing {
namespace {

double MeanError(const Location& location, const Bend& bend, const PixelBox& box) {
  double sum = 0;
  int count = 0;
  for (double y = 40; y < box.height - 40; y += 20) {
    for (double x = 40; x < box.width - 40; x += 20) {
      const Vec2 p = (*location.warp)({x, y});
      const Vec2 truth = bend.ToFrame({x + box.x, y + box.y});
      sum += std::hypot(p.x - truth.x, p.y - truth.y);
      ++count;
    }
  }
  return sum / count;
}

TEST(Tracker, FollowsABendingSheet) {
  const Tracker tracker = MakeTracker();
  EXPECT_GT(tracker.features().keypoints.size(), 100U);
  for (int frame = 0; frame < 6; ++frame) {
    const Bend bend{0.2 * frame, 15.0 * frame, {3.0 * frame, -2.0 * frame}};
    const Location found = tracker.Find(tracker.Describe(BentImage(Template(), bend)));
    ASSERT_TRUE(found.found) << "frame " << frame << ": " << ToString(found.reason);
    EXPECT_EQ(found.reason, LostReason::kNone);
    EXPECT_GT(found.inlier_rate(), 0.6);
    EXPECT_LT(MeanError(found, bend, tracker.box()), 1.5) << "frame " << frame;
    EXPECT_GE(found.outline.size(), 3U);
    ASSERT_TRUE(found.mesh);
    EXPECT_EQ(found.mesh->reference_width, kWidth);
    EXPECT_EQ(found.mesh->columns, 17);
    // Believable points of the mesh never mirror.
    for (int r = 0; r < found.mesh->rows; ++r) {
      for (int c = 0; c < found.mesh->columns; ++c) {
        if (!found.mesh->trusted[static_cast<std::size_t>(r * found.mesh->columns + c)]) continue;
        const auto [a, b, d, e] = found.warp->Jacobian(found.mesh->reference_point(c, r));
        EXPECT_GT(a * e - b * d, 0);
      }
    }
  }
}

// Notes what images are described for.
class NotingDescriptor final : public Descriptor {
 public:
  const DescriptorInfo& info() const override { return inner_->info(); }
  Descriptors Describe(const Image& grey, std::span<const Keypoint> keypoints,
                       int threads) const override {
    ++queries;
    return inner_->Describe(grey, keypoints, threads);
  }
  Descriptors DescribeReference(const Image& grey, std::span<const Keypoint> keypoints,
                                int threads) const override {
    ++references;
    return inner_->Describe(grey, keypoints, threads);
  }
  mutable int queries = 0;
  mutable int references = 0;

 private:
  std::shared_ptr<const Descriptor> inner_ = MakeDescriptor("rootsift");
};

TEST(Tracker, OnlyTheTemplateIsAReference) {
  const auto noting = std::make_shared<const NotingDescriptor>();
  TrackerOptions options;
  options.threads = 1;
  const Tracker tracker(noting, Template(), options);
  EXPECT_EQ(noting->references, 1);
  EXPECT_EQ(noting->queries, 0);
  tracker.Describe(Template());
  EXPECT_EQ(noting->references, 1);
  EXPECT_EQ(noting->queries, 1);
}

TEST(Tracker, ARegionIsATemplateOfItsOwn) {
  TrackerOptions options;
  options.region = PixelBox{120, 60, 200, 160};
  const Tracker tracker = MakeTracker(options);
  EXPECT_EQ(tracker.image().width, 200);
  EXPECT_EQ(tracker.image().pixels[0], Template().pixels[60 * kWidth + 120]);
  for (const Keypoint& k : tracker.features().keypoints) {
    EXPECT_GE(k.x, -0.5F);
    EXPECT_LE(k.x, 199.5F);
    EXPECT_LE(k.y, 159.5F);
  }
  const Bend bend{0.6, 25, {4, 4}};
  const Location found = tracker.Find(tracker.Describe(BentImage(Template(), bend)));
  ASSERT_TRUE(found.found) << ToString(found.reason);
  EXPECT_LT(MeanError(found, bend, tracker.box()), 2);
  const Vec2 corner = bend.ToFrame({120, 60});
  EXPECT_LT(std::hypot(found.mesh->points[0].x - corner.x, found.mesh->points[0].y - corner.y), 12);
}

TEST(Tracker, AMaskLeavesOutWhatIsNotTheObject) {
  TrackerOptions options;
  options.mask = Image{kWidth, kHeight, 1, std::vector<std::uint8_t>(kWidth * kHeight, 0)};
  for (int y = 50; y < 250; ++y) {
    for (int x = 100; x < 300; ++x) {
      if (x + y < 450) options.mask.pixels[static_cast<std::size_t>(y) * kWidth + x] = 255;
    }
  }
  const Tracker tracker = MakeTracker(options);
  EXPECT_EQ(tracker.box().x, 100);
  EXPECT_EQ(tracker.box().height, 200);
  EXPECT_GT(tracker.features().keypoints.size(), 30U);
  for (const Keypoint& k : tracker.features().keypoints) EXPECT_LT(k.x + 100 + k.y + 50, 452);
}

TEST(Tracker, KeepsTheStrongestOfTheRegionOnly) {
  TrackerOptions options;
  options.extraction.keypoints.max_keypoints = 40;
  options.region = PixelBox{20, 20, 100, 100};
  EXPECT_EQ(MakeTracker(options).features().keypoints.size(), 40U);
}

TEST(Tracker, SaysWhyItIsLost) {
  const Tracker tracker = MakeTracker();
  const Location flat =
      tracker.Find(tracker.Describe({kWidth, kHeight, 1, std::vector<std::uint8_t>(120000, 90)}));
  EXPECT_FALSE(flat.found);
  EXPECT_EQ(flat.reason, LostReason::kFewKeypoints);
  for (std::uint64_t seed = 2; seed < 12; ++seed) {
    const Location other = tracker.Find(tracker.Describe(Template(seed)));
    EXPECT_FALSE(other.found) << "seed " << seed << ", inliers " << other.inliers.size();
    EXPECT_NE(other.reason, LostReason::kNone);
    EXPECT_FALSE(other.warp.has_value());
    EXPECT_FALSE(other.mesh.has_value());
    EXPECT_TRUE(other.outline.empty());
  }
  // Seen in a mirror it is another object.
  Image mirrored = Template();
  for (int y = 0; y < kHeight; ++y) {
    const auto row = mirrored.pixels.begin() + static_cast<std::ptrdiff_t>(y) * kWidth;
    std::reverse(row, row + kWidth);
  }
  EXPECT_FALSE(tracker.Find(tracker.Describe(mirrored)).found);
}

TEST(Tracker, RefusesTemplatesThatCannotWork) {
  const auto with_region = [](PixelBox box) {
    TrackerOptions options;
    options.region = box;
    return options;
  };
  for (const PixelBox& box :
       {PixelBox{-1, 0, 50, 50}, PixelBox{0, 0, 401, 50}, PixelBox{380, 0, 50, 50},
        PixelBox{0, 0, 15, 50}, PixelBox{0, 2147483647, 50, 50}, PixelBox{0, 0, 0, 0}}) {
    ExpectError(ErrorCode::kInvalidArgument, "region_invalid",
                [&] { MakeTracker(with_region(box)); });
  }
  TrackerOptions masked;
  masked.mask = Image{10, 10, 1, std::vector<std::uint8_t>(100, 255)};
  ExpectError(ErrorCode::kInvalidArgument, "mask_invalid", [&] { MakeTracker(masked); });
  masked.mask = Image{kWidth, kHeight, 1, std::vector<std::uint8_t>(kWidth * kHeight, 0)};
  ExpectError(ErrorCode::kInvalidArgument, "mask_invalid", [&] { MakeTracker(masked); });
  const Image flat{kWidth, kHeight, 1, std::vector<std::uint8_t>(kWidth * kHeight, 7)};
  ExpectError(ErrorCode::kUnprocessable, "too_few_features", [&] { MakeTracker({}, flat); });
  TrackerOptions few;
  few.locate.min_inliers = 3;
  ExpectError(ErrorCode::kInvalidArgument, "bad_min_inliers", [&] { MakeTracker(few); });
  TrackerOptions none;
  none.locate.verification.ransac.iterations = 0;
  const Tracker tracker = MakeTracker(none);
  EXPECT_THROW(tracker.Find(tracker.Describe(Template())), Error);
}

}  // namespace
}  // namespace pliant::testing
