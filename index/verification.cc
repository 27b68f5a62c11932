// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verification.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "descriptor/error.h"
#include "descriptor/matching.h"
#include "index/outline.h"

namespace pliant {
namespace {

constexpr int kOutlinePointsASide = 8;
constexpr double kMaxFrameScaleFactor = 4;

void Check(const Features& features, const char* what) {
  CheckDescriptors(features.descriptors, what);
  if (features.descriptors.rows != features.keypoints.size()) {
    throw Error(ErrorCode::kInvalidArgument, "features_malformed",
                std::string(what) + ": as many descriptors as key points are needed.");
  }
}

const Features& Checked(const Features& query) {
  // A picture without key points has descriptors without rows, whose dim may be 0.
  if (!query.keypoints.empty() || query.descriptors.rows != 0) Check(query, "query");
  return query;
}

double MedianScale(const ThinPlateSpline& warp, const std::vector<Vec2>& points) {
  std::vector<double> scales;
  for (const Vec2 p : points) {
    const auto [a, b, c, d] = warp.Jacobian(p);
    scales.push_back(std::sqrt(std::max(0.0, a * d - b * c)));
  }
  const auto middle = scales.begin() + static_cast<std::ptrdiff_t>(scales.size() / 2);
  std::nth_element(scales.begin(), middle, scales.end());
  return *middle;
}

std::vector<Vec2> Outline(const Features& query, const Features& reference,
                          const VerificationResult& result) {
  std::vector<Vec2> in_query;
  std::vector<Vec2> in_reference;
  for (const MatchedPair& pair : result.inliers) {
    const Keypoint& q = query.keypoints[pair.query];
    const Keypoint& r = reference.keypoints[pair.reference];
    in_query.push_back({q.x, q.y});
    in_reference.push_back({r.x, r.y});
  }
  const ThinPlateSpline& warp = *result.warp;
  if (MapsFrameSanely(warp, reference.width, reference.height, MedianScale(warp, in_reference),
                      kMaxFrameScaleFactor)) {
    auto frame = WarpFrame(warp, reference.width, reference.height, kOutlinePointsASide);
    if (!CrossesItself(frame)) return frame;
  }
  return ConvexHull(std::move(in_query));
}

}  // namespace

Verifier::Verifier(const Features& query, const VerificationOptions& options)
    : query_(Checked(query)), options_(options), packed_(query.descriptors) {
  if (!(options.tolerance > 0 && options.tolerance < 1)) {
    throw Error(ErrorCode::kInvalidArgument, "bad_tolerance",
                "tolerance must be above 0 and below 1.");
  }
  options_.ransac.tolerance_px =
      std::max(1.0, options.tolerance * std::max(query.width, query.height));
}

VerificationResult Verifier::Verify(const Features& reference) const {
  if (reference.model_id != query_.model_id) {
    throw Error(ErrorCode::kConflict, "model_mismatch",
                "Features of model " + query_.model_id +
                    " cannot be verified against features of "
                    "model " +
                    reference.model_id + ".");
  }
  VerificationResult result;
  if (query_.keypoints.empty() || reference.keypoints.empty()) return result;
  Check(reference, "reference");
  const auto matches = MatchDescriptors(
      packed_, reference.descriptors,
      {.max_ratio = options_.max_ratio, .mutual_only = true, .threads = options_.threads});
  result.matches = static_cast<int>(matches.size());
  std::vector<Correspondence> correspondences;
  correspondences.reserve(matches.size());
  for (const Match& match : matches) {
    const Keypoint& q = query_.keypoints[match.query];
    const Keypoint& r = reference.keypoints[match.reference];
    const bool sized = q.size > 0 && r.size > 0;
    correspondences.push_back(
        {{r.x, r.y}, {q.x, q.y}, sized ? static_cast<double>(q.size) / r.size : 0.0});
  }
  TpsRansacResult agreed = TpsRansac(correspondences, options_.ransac);
  result.failure = agreed.failure;
  result.warp = std::move(agreed.warp);
  for (const std::uint32_t i : agreed.inliers) {
    result.inliers.push_back({matches[i].query, matches[i].reference});
  }
  if (!result.warp) return result;
  result.inlier_fraction = static_cast<double>(result.inliers.size()) / result.matches;
  result.outline = Outline(query_, reference, result);
  return result;
}

double CombineScores(double ranking_score, int inliers) {
  const double evidence = std::max(0, inliers - 4);
  return ranking_score + (1 - ranking_score) * evidence / (evidence + 10);
}

}  // namespace pliant
