// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Following frame by frame, and what is drawn of it.
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "index/tracking/pipeline.h"
#include "index/tracking/track_image.h"
#include "tests/unit/tracker_fixture.h"

namespace pliant::testing {
namespace {

// A source of bent frames that fails, if asked to, instead of giving frame `fails_at`.
class BentFrames : public FrameSource {
 public:
  explicit BentFrames(int count, int fails_at = -1) : count_(count), fails_at_(fails_at) {
    info_ = {kWidth, kHeight, 10, 0};
  }
  std::optional<Frame> Next() override {
    if (at_ == fails_at_) throw Error(ErrorCode::kUnprocessable, "frames_vary", "as asked");
    if (at_ == count_) return std::nullopt;
    Frame frame{at_, at_ / 10.0, {}, {}};
    frame.image = at_ == 2 ? Template(99)
                           : BentImage(Template(), Bend{0.1 * static_cast<double>(at_), 0, {}});
    ++at_;
    return frame;
  }

 private:
  int count_;
  int fails_at_;
  std::int64_t at_ = 0;
};

TEST(TrackFrames, GivesEveryFrameInOrder) {
  const Tracker tracker = MakeTracker();
  BentFrames source(7);
  std::vector<std::int64_t> seen;
  ContactSheet sheet(tracker.image(), 3);
  const TrackSummary summary = TrackFrames(source, tracker, [&](const TrackedFrame& tracked) {
    seen.push_back(tracked.frame.number);
    EXPECT_EQ(tracked.location.found, tracked.frame.number != 2);
    EXPECT_THAT(Caption(tracked),
                ::testing::HasSubstr(tracked.frame.number != 2 ? "inliers " : "lost: "));
    const Image image = DrawTracked(tracked, tracker.box());
    EXPECT_EQ(image.height, kHeight);
    EXPECT_GT(image.width, 2 * kWidth);
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
  ContactSheet sheet(tracker.image(), 4);
  EXPECT_THROW(sheet.Draw("none"), Error);
  TrackedFrame tracked;
  tracked.frame.image = Template(3);
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

}  // namespace
}  // namespace pliant::testing
