// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The tracking benchmark on small simulated sequences: its figures against each other, and DEAL
// against the baselines with a margin.
#include "index/tracking/tracking_benchmark.h"

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "descriptor/simulation/simulate.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_images.h"

namespace pliant {
namespace {

using testing::ExpectError;

// Two groups of small sequences, made once.
const std::filesystem::path& Sequences() {
  static const testing::TemporaryFolder folder;
  static const std::filesystem::path path = [] {
    for (const char* group : {"calm", "wild"}) {
      SimulateOptions options;
      options.textures = "procedural";
      options.out = (folder / group).string();
      options.preset = "sequence";
      options.scenes = 1;
      options.views = 4;
      options.width = 400;
      options.height = 300;
      options.occluders = 0;
      options.strength = group == std::string("calm") ? 0.3 : 0.8;
      options.turn_deg = group == std::string("calm") ? 40 : 120;
      options.seed = 5;
      Simulate(options);
    }
    return folder.path();
  }();
  return path;
}

TEST(TrackingBenchmark, DealFollowsBestAndFiguresFitTogether) {
  const std::vector<TrackingSequence> sequences = OpenTrackingSequences(Sequences());
  ASSERT_EQ(sequences.size(), 2U);
  EXPECT_EQ(sequences[0].group, "calm");
  EXPECT_EQ(sequences[1].group, "wild");
  TrackingBenchmarkOptions options;
  options.descriptors = {"deal", "sift", "orb"};
  options.max_keypoints = 400;
  std::uint64_t told = 0;
  options.progress = [&](std::uint64_t done, std::uint64_t total) {
    EXPECT_EQ(total, 6U);
    told = done;
    return true;
  };
  const TrackingReport report = RunTrackingBenchmark(sequences, options);
  EXPECT_EQ(told, 6U);
  EXPECT_EQ(report.frames + report.unseen, 6);
  EXPECT_GE(report.frames, 5);
  ASSERT_EQ(report.results.size(), 3U);
  EXPECT_EQ(report.views.size(), static_cast<std::size_t>(3 * report.frames));
  for (const TrackingResult& result : report.results) {
    EXPECT_EQ(result.frames, report.frames);
    EXPECT_LE(result.tracked_share, result.found_share);
    EXPECT_GE(result.inlier_rate, 0);
    EXPECT_LE(result.inlier_rate, 1);
    EXPECT_LE(result.ssim, 1);
  }
  ASSERT_EQ(report.groups.size(), 2U);
  EXPECT_EQ(report.groups[0].frames + report.groups[1].frames, report.frames);
  for (const TrackedView& view : report.views) {
    EXPECT_EQ(view.found, view.reason == LostReason::kNone);
    EXPECT_LE(view.inliers, view.matches);
    EXPECT_EQ(view.tracked, view.found && view.error_px <= 0.03 * view.size_px);
  }
  const TrackingResult& deal = report.results[0];
  const TrackingResult& sift = report.results[1];
  const TrackingResult& orb = report.results[2];
  RecordProperty("deal_inlier_rate", std::to_string(deal.inlier_rate));
  EXPECT_GT(deal.inlier_rate, sift.inlier_rate) << "by a fifth and more with the shipped weights";
  EXPECT_GT(deal.inlier_rate, orb.inlier_rate);
  EXPECT_GE(deal.tracked_share + 0.2, sift.tracked_share) << "a frame of six may be lost";
  EXPECT_GE(deal.found_share, 0.8);
  EXPECT_LT(deal.error_px, 8);
  EXPECT_GT(deal.ssim, 0.2);
}

TEST(TrackingBenchmark, SameWhateverTheThreadsAndFewerFramesWhenAsked) {
  const auto sequences = OpenTrackingSequences(Sequences());
  const auto calm = OpenTrackingSequences(Sequences() / "calm");
  ASSERT_EQ(calm.size(), 1U);
  EXPECT_TRUE(calm[0].group.empty());
  TrackingBenchmarkOptions options;
  options.descriptors = {"rootsift"};
  options.jobs = 1;
  const TrackingReport one = RunTrackingBenchmark(sequences, options);
  options.jobs = 2;
  const TrackingReport two = RunTrackingBenchmark(sequences, options);
  ASSERT_EQ(one.views.size(), two.views.size());
  for (std::size_t i = 0; i < one.views.size(); ++i) {
    EXPECT_EQ(one.views[i].inliers, two.views[i].inliers);
    EXPECT_EQ(one.views[i].error_px, two.views[i].error_px);
  }
  EXPECT_TRUE(RunTrackingBenchmark(calm, options).groups.empty());
  options.every = 2;
  EXPECT_LT(RunTrackingBenchmark(sequences, options).frames, one.frames);
}

TEST(TrackingBenchmark, RefusesWhatItCannotMeasure) {
  const testing::TemporaryFolder folder;
  EXPECT_THROW(OpenTrackingSequences(folder.path()), Error);
  EXPECT_THROW(OpenTrackingSequences(folder / "nowhere"), Error);
  const auto sequences = OpenTrackingSequences(Sequences());
  TrackingBenchmarkOptions options;
  options.descriptors = {"nonsense"};
  ExpectError(ErrorCode::kInvalidArgument, "unknown_descriptor",
              [&] { RunTrackingBenchmark(sequences, options); });
  options.descriptors = {"orb"};
  options.progress = [](std::uint64_t, std::uint64_t) { return false; };
  ExpectError(ErrorCode::kCancelled, "evaluation_stopped",
              [&] { RunTrackingBenchmark(sequences, options); });
  ExpectError(ErrorCode::kUnprocessable, "no_frames", [&] { RunTrackingBenchmark({}, options); });
}

}  // namespace
}  // namespace pliant
