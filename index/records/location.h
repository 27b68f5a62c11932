// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Where one object is in one image. Plain values, computed by index/verify/locate.h.
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

// Why an object is lost.
enum class LostReason {
  kNone,          // it is found
  kFewKeypoints,  // the image has too few
  kFewMatches,    // too few descriptors have a match
  kNoAgreement,   // the matches fit no smooth warp
  kDegenerate,    // the inliers lie on a line
  kFolded,        // the warp folds over or tears near the inliers
  kFewInliers,    // the few inliers can be chance
  kSmallPatch,    // all inliers lie in one small part of the object
};

struct Location {
  bool found = false;
  LostReason reason = LostReason::kFewKeypoints;
  int keypoints = 0;                 // of the image
  int matches = 0;                   // mutual nearest neighbours within the ratio
  std::vector<MatchedPair> inliers;  // of RANSAC, also if the object is lost
  // The other fields: only if found. The warp maps pixels of the object's own image.
  std::optional<ThinPlateSpline> warp;
  std::vector<Vec2> outline;  // in the image, in order, not closed
  std::optional<Mesh> mesh;

  double inlier_rate() const {  // inliers / matches; 0 without matches
    return matches > 0 ? static_cast<double>(inliers.size()) / matches : 0;
  }
};

}  // namespace pliant
