// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The tracking benchmark of `pliant eval tracking`: an object is tracked through simulated
// sequences with ground truth.
//
// The template is view 0 of a scene, its region the object, described as a reference
// (Descriptor::DescribeReference). All descriptors get the same keypoints. For every other view:
//   inlier rate = RANSAC's inliers / matches, also where the object counts as lost;
//   error = mean distance between warp and ground truth over the template's points (every 8 pixels)
//     that are visible in the view, in pixels of the view; only where found;
//   tracked = found, and the error is at most 3 % of the object's size: the longer side of the box
//     around those points in the view;
//   SSIM = mean structural similarity of the un-warped view and the template at those points; 0
//     where lost.
// Views that show fewer than 20 of the points are excluded.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "descriptor/evaluation/dataset.h"
#include "descriptor/evaluation/truth_scene.h"
#include "index/tracking/tracker.h"
#include "index/verify/locate.h"

namespace pliant {

struct TrackingSequence {
  std::string group;  // sub-folder of the set; may be empty
  evaluation::SceneEntry scene;
};

// The scenes of a folder that `pliant simulate` wrote, or of each of its sub-folders, which then
// are groups. Throws what OpenDataset throws, kInvalidArgument "not_simulated" for other data sets.
std::vector<TrackingSequence> OpenTrackingSequences(const std::filesystem::path& folder);

struct TrackingBenchmarkOptions {
  std::vector<std::string> descriptors = {"deal", "deal-fixed", "rootsift", "sift", "orb"};
  std::filesystem::path model;  // weights; empty = ModelPath(name)
  int max_keypoints = 1024;     // of the template's region, and of each view; 1 to 4096
  // max_ratio is 1: all mutual nearest neighbours, the paper's brute-force association.
  LocateOptions locate = {.verification = {.max_ratio = 1}};
  double tracked_error = 0.03;  // of the object's size
  int every = 1;                // only every n-th view after the template; 1 or more
  int jobs = 0;                 // threads, one sequence each; 0 = one per core
  // Called after each view, from any thread, never concurrently. Returning false stops.
  std::function<bool(std::uint64_t done, std::uint64_t total)> progress;
};

struct TrackedView {
  std::size_t sequence = 0;  // number in the report
  std::size_t descriptor = 0;
  int view = 0;
  double time = 0;  // position in the sequence, 0..1
  bool found = false;
  LostReason reason = LostReason::kNone;
  int matches = 0;
  int inliers = 0;
  double inlier_rate = 0;
  double error_px = 0;  // only when found
  double size_px = 0;   // of the object
  bool tracked = false;
  double ssim = 0;
};

// Means over views.
struct TrackingResult {
  std::string descriptor;
  std::string model_id;
  int frames = 0;
  double inlier_rate = 0;
  double ssim = 0;
  double error_px = 0;  // over the views in which it was found
  double tracked_share = 0;
  double found_share = 0;
};

struct TrackingReport {
  struct Subset {
    std::string name;
    int sequences = 0;
    int frames = 0;
    std::vector<TrackingResult> results;
  };
  int frames = 0;
  int unseen = 0;                       // excluded views
  std::vector<std::string> sequences;   // "group/scene"
  std::vector<TrackingResult> results;  // one per descriptor
  std::vector<Subset> groups;           // empty when there is only one
  std::vector<TrackedView> views;       // by sequence, view, descriptor
};

// Deterministic, independently of `jobs`. Throws what MakeDescriptor, Validate(LocateOptions) and
// the scenes' readers throw, kUnprocessable "no_frames" when nothing can be measured, kCancelled
// "evaluation_stopped".
TrackingReport RunTrackingBenchmark(const std::vector<TrackingSequence>& sequences,
                                    const TrackingBenchmarkOptions& options);

// Means of `views` that `take` accepts, for each of the descriptors (names and model ids of
// `like`).
std::vector<TrackingResult> SummarizeViews(const std::vector<TrackedView>& views,
                                           const std::vector<TrackingResult>& like,
                                           const std::function<bool(const TrackedView&)>& take);

}  // namespace pliant
