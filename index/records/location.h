// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Where one object is in one image. Plain values; index/verify/locate.h works them out.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "descriptor/warp/tps.h"
#include "index/records/explanation.h"

namespace pliant {

struct MatchedPair {
  std::uint32_t query = 0;  // keypoint numbers
  std::uint32_t reference = 0;
};

// Why an object counts as lost.
enum class LostReason {
  kNone,          // it is found
  kFewKeypoints,  // the image has hardly any
  kFewMatches,    // too few descriptors found a partner
  kNoAgreement,   // the matches agree on no smooth warp
  kDegenerate,    // those that agree lie on a line
  kFolded,        // the warp folds over, or tears, where it should hold
  kFewInliers,    // so few agree that it may be chance
  kSmallPatch,    // all that agree lie in one small spot of the object
};

struct Location {
  bool found = false;
  LostReason reason = LostReason::kFewKeypoints;
  int keypoints = 0;                 // of the image
  int matches = 0;                   // mutual nearest neighbours within the ratio
  std::vector<MatchedPair> inliers;  // what RANSAC says, also when the object counts as lost
  // The rest only when found. The warp maps pixels of the object's own image.
  std::optional<ThinPlateSpline> warp;
  std::vector<Vec2> outline;  // in the image, in order, not closed
  std::optional<Mesh> mesh;

  double inlier_rate() const {  // inliers / matches; 0 without matches
    return matches > 0 ? static_cast<double>(inliers.size()) / matches : 0;
  }
};

}  // namespace pliant
