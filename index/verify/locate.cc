// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/locate.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>

#include "descriptor/base/error.h"
#include "index/verify/warp_geometry.h"

namespace pliant {
namespace {

struct Reason {
  LostReason reason;
  const char* word;
  const char* sentence;
  std::optional<TpsRansacFailure> failure = {};  // that it comes from
};

constexpr Reason kReasons[] = {
    {LostReason::kNone, "none", "found", TpsRansacFailure::kNone},
    {LostReason::kFewKeypoints, "few_keypoints", "the image has too few keypoints"},
    {LostReason::kFewMatches, "few_matches", "too few keypoints match", TpsRansacFailure::kTooFew},
    {LostReason::kNoAgreement, "no_agreement", "the matches do not fit one smooth warp",
     TpsRansacFailure::kNoAgreement},
    {LostReason::kDegenerate, "degenerate", "the inliers lie on one line",
     TpsRansacFailure::kDegenerate},
    {LostReason::kFolded, "folded", "the warp folds over", TpsRansacFailure::kFolded},
    {LostReason::kFewInliers, "few_inliers", "too few inliers: they can be chance"},
    {LostReason::kSmallPatch, "small_patch", "all inliers lie in one small area"}};

double Area(const std::vector<Vec2>& polygon) {
  double twice = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec2 a = polygon[i];
    const Vec2 b = polygon[(i + 1) % polygon.size()];
    twice += a.x * b.y - b.x * a.y;
  }
  return std::abs(twice) / 2;
}

// The share of the mesh's points in the hull of the inliers where the warp mirrors or stretches too
// much (see WarpMesh). Elsewhere the spline extrapolates, and the mesh says where.
double FoldedShare(const Mesh& mesh, const std::vector<Vec2>& hull) {
  int held = 0;
  int folded = 0;
  for (int r = 0; r < mesh.rows; ++r) {
    for (int c = 0; c < mesh.columns; ++c) {
      if (!IsInside(mesh.reference_point(c, r), hull)) continue;
      ++held;
      folded += mesh.trusted[static_cast<std::size_t>(r) * mesh.columns + c] ? 0 : 1;
    }
  }
  return held > 0 ? static_cast<double>(folded) / held : 0;
}

LostReason Judge(const Features& object, const VerificationResult& result, const Mesh& mesh,
                 const LocateOptions& options) {
  if (result.inliers.size() < static_cast<std::size_t>(options.min_inliers)) {
    return LostReason::kFewInliers;
  }
  const auto hull = ConvexHull(PointsOf(object.keypoints, result.inliers, &MatchedPair::reference));
  const double whole = static_cast<double>(object.width) * object.height;
  if (Area(hull) < options.min_patch * whole) return LostReason::kSmallPatch;
  if (FoldedShare(mesh, hull) > options.max_folded) return LostReason::kFolded;
  return LostReason::kNone;
}

}  // namespace

const char* ToString(LostReason reason) {
  return std::ranges::find(kReasons, reason, &Reason::reason)->word;
}

const char* Describe(LostReason reason) {
  return std::ranges::find(kReasons, reason, &Reason::reason)->sentence;
}

void Validate(const LocateOptions& options) {
  const auto require = [](bool holds, const char* field, const char* rule) {
    if (holds) return;
    throw Error(ErrorCode::kInvalidArgument, std::string("bad_") + field,
                std::string(field) + " must be " + rule + ".");
  };
  require(options.min_inliers >= 4, "min_inliers", "4 or more");
  require(options.min_patch >= 0 && options.min_patch < 1, "min_patch", "0 to below 1");
  require(options.max_folded >= 0 && options.max_folded <= 1, "max_folded", "0 to 1");
}

Location Locate(const Verifier& image, const Features& image_features, const Features& object,
                const LocateOptions& options) {
  Location location;
  location.keypoints = static_cast<int>(image_features.keypoints.size());
  if (location.keypoints < options.min_inliers) return location;
  VerificationResult result = image.Verify(object);
  location.matches = result.matches;
  location.reason = std::ranges::find(kReasons, result.failure, &Reason::failure)->reason;
  location.inliers = result.inliers;
  if (!result.warp) return location;
  Mesh mesh = WarpMesh(*result.warp, object.width, object.height);
  location.reason = Judge(object, result, mesh, options);
  if (location.reason != LostReason::kNone) return location;
  location.found = true;
  location.warp = std::move(result.warp);
  location.outline = std::move(result.outline);
  location.mesh = std::move(mesh);
  return location;
}

}  // namespace pliant
