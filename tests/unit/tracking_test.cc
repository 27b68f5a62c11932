// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The tracker on frames bent by a known map, and on what cannot be tracked.
#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "descriptor/error.h"
#include "descriptor/local_affine.h"
#include "descriptor/unwarp.h"
#include "index/outline.h"
#include "index/tracking/pipeline.h"
#include "index/tracking/track_picture.h"
#include "index/tracking/tracker.h"
#include "tests/unit/bent_pictures.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_pictures.h"
#include "tests/unit/random_descriptors.h"

namespace pliant {
namespace {

using testing::Bend;
using testing::BentPicture;
using testing::ExpectError;

constexpr int kWidth = 400;
constexpr int kHeight = 300;

Image Template(std::uint64_t seed = 1) { return testing::RichPicture(seed, kWidth, kHeight); }

Tracker MakeTracker(TrackerOptions options = {}, const Image& reference = Template()) {
  options.threads = 1;
  return {MakeDescriptor("rootsift"), reference, options};
}

double MeanError(const Location& location, const Bend& bend, const TemplateBox& box) {
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
    const Location found = tracker.Find(tracker.Describe(BentPicture(Template(), bend)));
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

TEST(Tracker, ARegionIsATemplateOfItsOwn) {
  TrackerOptions options;
  options.region = TemplateBox{120, 60, 200, 160};
  const Tracker tracker = MakeTracker(options);
  EXPECT_EQ(tracker.picture().width, 200);
  EXPECT_EQ(tracker.picture().pixels[0], Template().pixels[60 * kWidth + 120]);
  for (const Keypoint& k : tracker.features().keypoints) {
    EXPECT_GE(k.x, -0.5F);
    EXPECT_LE(k.x, 199.5F);
    EXPECT_LE(k.y, 159.5F);
  }
  const Bend bend{0.6, 25, {4, 4}};
  const Location found = tracker.Find(tracker.Describe(BentPicture(Template(), bend)));
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
  options.region = TemplateBox{20, 20, 100, 100};
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
  const auto with_region = [](TemplateBox box) {
    TrackerOptions options;
    options.region = box;
    return options;
  };
  for (const TemplateBox& box :
       {TemplateBox{-1, 0, 50, 50}, TemplateBox{0, 0, 401, 50}, TemplateBox{380, 0, 50, 50},
        TemplateBox{0, 0, 15, 50}, TemplateBox{0, 2147483647, 50, 50}, TemplateBox{0, 0, 0, 0}}) {
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

// Two pictures of the same key points (same descriptors), placed by `place`.
Location LocatePlaced(const std::function<Vec2(Vec2)>& place,
                      const std::function<Vec2(int)>& reference) {
  constexpr int kPoints = 120;
  Features object;
  object.width = kWidth;
  object.height = kHeight;
  object.model_id = "test:1";
  object.descriptors = testing::RandomFloats(kPoints, 64, 5);
  for (int i = 0; i < kPoints; ++i) {
    const Vec2 p = reference(i);
    object.keypoints.push_back({static_cast<float>(p.x), static_cast<float>(p.y), 6});
  }
  Features picture = object;
  for (Keypoint& k : picture.keypoints) {
    const Vec2 q = place({k.x, k.y});
    k.x = static_cast<float>(q.x);
    k.y = static_cast<float>(q.y);
  }
  const LocateOptions options;
  return Locate(Verifier(picture, options.verification), picture, object, options);
}

Vec2 Anywhere(int i) { return {37.0 * i - std::floor(37.0 * i / 397) * 397, i * 2.4}; }

TEST(Locate, DegenerateArrangementsAreLost) {
  const auto shift = [](Vec2 p) { return Vec2{p.x + 20, p.y + 5}; };
  EXPECT_TRUE(LocatePlaced(shift, Anywhere).found);
  const auto line = [](int i) { return Vec2{3.0 * i, 2.0 * i + 20}; };
  EXPECT_FALSE(LocatePlaced(shift, line).found);
  EXPECT_FALSE(LocatePlaced([](Vec2) { return Vec2{50, 50}; }, Anywhere).found);
  EXPECT_FALSE(LocatePlaced([](Vec2 p) { return Vec2{390 - p.x, p.y}; }, Anywhere).found);
  const auto spot = [](int i) {
    const Vec2 p = Anywhere(i);
    return Vec2{p.x / 12 + 200, p.y / 12 + 100};
  };
  const Location small = LocatePlaced(shift, spot);
  EXPECT_FALSE(small.found);
  EXPECT_EQ(small.reason, LostReason::kSmallPatch);
  EXPECT_GE(small.inliers.size(), 100U) << "what RANSAC says is kept";
}

TEST(Locate, AFoldedHalfDoesNotMakeAWildWarp) {
  // The right half is folded back over the left one.
  const Location found = LocatePlaced(
      [](Vec2 p) {
        return p.x < 240 ? p : Vec2{480 - p.x, p.y};
      },
      Anywhere);
  if (!found.found) return;
  for (const MatchedPair& pair : found.inliers) {
    const Vec2 p = Anywhere(static_cast<int>(pair.reference));
    const auto [a, b, c, d] = found.warp->Jacobian(p);
    EXPECT_TRUE(IsPlausible(a, b, c, d, TpsRansacOptions{}.max_anisotropy));
  }
  for (const Vec2 p : found.outline) {
    EXPECT_GT(p.x, -kWidth);
    EXPECT_LT(p.x, 2 * kWidth);
  }
}

TEST(Locate, JsonHasOneForm) {
  using Json = nlohmann::json;
  const Json found = Json::parse(LocationJson(LocatePlaced([](Vec2 p) { return p; }, Anywhere)));
  EXPECT_EQ(found["found"], true);
  EXPECT_TRUE(found["reason"].is_null());
  EXPECT_EQ(found["matches"], 120);
  EXPECT_EQ(found["inliers"], 120);
  EXPECT_EQ(found["inlier_rate"], 1.0);
  EXPECT_EQ(found["mesh"]["columns"], 17);
  EXPECT_GE(found["outline"].size(), 3U);
  const Json lost = Json::parse(LocationJson(LocatePlaced(
      [](Vec2) {
        return Vec2{5, 5};
      },
      Anywhere)));
  EXPECT_EQ(lost["found"], false);
  EXPECT_TRUE(lost["reason"].is_string());
  EXPECT_TRUE(lost["mesh"].is_null());
  EXPECT_TRUE(lost["outline"].is_null());
}

TEST(Locate, EveryReasonHasAWordAndASentence) {
  std::set<std::string> words;
  for (int i = 0; i <= static_cast<int>(LostReason::kSmallPatch); ++i) {
    words.insert(ToString(static_cast<LostReason>(i)));
    words.insert(Describe(static_cast<LostReason>(i)));
  }
  EXPECT_EQ(words.size(), 16U);
}

// A source of bent frames that fails, if asked to, instead of giving frame `fails_at`.
class BentFrames : public FrameSource {
 public:
  explicit BentFrames(int count, int fails_at = -1) : count_(count), fails_at_(fails_at) {}
  const FrameSourceInfo& info() const override { return info_; }
  const std::vector<SkippedFrame>& skipped() const override { return skipped_; }
  std::optional<Frame> Next() override {
    if (at_ == fails_at_) throw Error(ErrorCode::kUnprocessable, "frames_vary", "as asked");
    if (at_ == count_) return std::nullopt;
    Frame frame{at_, at_ / 10.0, {}, {}};
    frame.picture = at_ == 2 ? Template(99)
                             : BentPicture(Template(), Bend{0.1 * static_cast<double>(at_), 0, {}});
    ++at_;
    return frame;
  }

 private:
  int count_;
  int fails_at_;
  std::int64_t at_ = 0;
  FrameSourceInfo info_{kWidth, kHeight, 10, 0};
  std::vector<SkippedFrame> skipped_;
};

TEST(TrackFrames, GivesEveryFrameInOrder) {
  const Tracker tracker = MakeTracker();
  BentFrames source(7);
  std::vector<std::int64_t> seen;
  ContactSheet sheet(tracker.picture(), 3);
  const TrackSummary summary = TrackFrames(source, tracker, [&](const TrackedFrame& tracked) {
    seen.push_back(tracked.frame.number);
    EXPECT_EQ(tracked.location.found, tracked.frame.number != 2);
    EXPECT_THAT(Caption(tracked),
                ::testing::HasSubstr(tracked.frame.number != 2 ? "inliers " : "lost: "));
    const Image picture = DrawTracked(tracked, tracker.box());
    EXPECT_EQ(picture.height, kHeight);
    EXPECT_GT(picture.width, 2 * kWidth);
    sheet.Add(tracked, tracker.box());
    return true;
  });
  EXPECT_THAT(seen, ::testing::ElementsAre(0, 1, 2, 3, 4, 5, 6));
  EXPECT_EQ(summary.frames, 7);
  EXPECT_EQ(summary.found, 6);
  EXPECT_GT(summary.inlier_rate, 0.5);
  EXPECT_GT(summary.frames_per_second, 0);
  EXPECT_GT(sheet.Draw("seven frames").height, 300);
}

TEST(TrackFrames, PassesErrorsOnAndStopsWhenTold) {
  const Tracker tracker = MakeTracker();
  BentFrames broken(7, 3);
  int seen = 0;
  const auto count = [&](const TrackedFrame&) { return ++seen > 0; };
  ExpectError(ErrorCode::kUnprocessable, "frames_vary",
              [&] { TrackFrames(broken, tracker, count); });
  EXPECT_EQ(seen, 3);
  BentFrames endless(1'000'000'000);
  const TrackSummary summary =
      TrackFrames(endless, tracker, [](const TrackedFrame& t) { return t.frame.number < 1; });
  EXPECT_EQ(summary.frames, 2);
  BentFrames another(5);
  EXPECT_THROW(TrackFrames(another, tracker,
                           [](const TrackedFrame&) -> bool { throw std::runtime_error("full"); }),
               std::runtime_error);
}

TEST(ContactSheet, KeepsFewOfManyFrames) {
  const Tracker tracker = MakeTracker();
  ContactSheet sheet(tracker.picture(), 4);
  EXPECT_THROW(sheet.Draw("none"), Error);
  TrackedFrame tracked;
  tracked.frame.picture = Template(3);
  int one = 0;
  for (int i = 0; i < 100; ++i) {
    tracked.frame.number = i;
    sheet.Add(tracked, tracker.box());
    if (i == 0) one = sheet.Draw("one").height;
  }
  const Image drawn = sheet.Draw("many");
  EXPECT_GT(drawn.height, one);
  EXPECT_LT(drawn.height, 3 * one);
}

TEST(Unwarp, LaysTheBentObjectFlat) {
  const Tracker tracker = MakeTracker();
  const Bend bend{1, 20, {5, 0}};
  const Image frame = BentPicture(Template(), bend);
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
}  // namespace pliant
