// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Where is this object in that picture? What the tracker asks of every frame, and the server of one
// picture: the verification of retrieval, and a judgement of whether its warp may be believed.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "descriptor/features/features.h"
#include "descriptor/warp/tps.h"
#include "index/verify/verification.h"
#include "index/verify/warp_mesh.h"

namespace pliant {

// Why an object counts as lost.
enum class LostReason {
  kNone,          // it is found
  kFewKeypoints,  // the picture has hardly any
  kFewMatches,    // too few descriptors found a partner
  kNoAgreement,   // the matches agree on no smooth warp
  kDegenerate,    // those that agree lie on a line
  kFolded,        // the warp folds over, or tears, where it should hold
  kFewInliers,    // so few agree that it may be chance
  kSmallPatch,    // all that agree lie in one small spot of the object
};
// A stable word for programs: "few_matches".
const char* ToString(LostReason reason);
// A sentence for people.
std::string Describe(LostReason reason);

struct LocateOptions {
  // ransac.iterations is 1500, as in the paper (Potje et al. 2021, supplement: "Non-Rigid Object
  // Tracking"); ransac.regularization is the spline's.
  VerificationOptions verification;
  int min_inliers = 8;  // among unlike pictures up to seven agree by chance
  // Of the object's area that the inliers' convex hull must cover.
  double min_patch = 0.02;
  // Share of the mesh near inliers that may mirror or tear (real folds do).
  double max_folded = 0.15;
  int mesh_points = 17;  // on the object's longer side
};

struct Location {
  bool found = false;
  LostReason reason = LostReason::kFewKeypoints;
  int keypoints = 0;                 // of the picture
  int matches = 0;                   // mutual nearest neighbours within the ratio
  std::vector<MatchedPair> inliers;  // what RANSAC says, also when the object counts as lost
  // The rest only when found. The warp maps pixels of the object's own picture.
  std::optional<ThinPlateSpline> warp;
  std::vector<Vec2> outline;  // in the picture, in order, not closed
  std::optional<Mesh> mesh;

  double inlier_rate() const {  // inliers / matches; 0 without matches
    return matches > 0 ? static_cast<double>(inliers.size()) / matches : 0;
  }
};

// `picture` must be made from `picture_features` with options.verification. Nothing found is no
// error. Throws what Verifier::Verify throws. Thread-safe.
Location Locate(const Verifier& picture, const Features& picture_features, const Features& object,
                const LocateOptions& options);

// Throws kInvalidArgument naming the field.
void Validate(const LocateOptions& options);

}  // namespace pliant
