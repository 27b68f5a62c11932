// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/explain.h"

#include <algorithm>
#include <utility>

#include "index/verify/warp_mesh.h"

namespace pliant {
namespace {

std::string FailureInWords(const VerificationResult& result) {
  const std::string matches = std::to_string(result.matches);
  switch (result.failure) {
    case TpsRansacFailure::kNone:
      return "";
    case TpsRansacFailure::kTooFew:
      return "Only " + matches + " keypoints look alike in both images; that is too few.";
    case TpsRansacFailure::kNoAgreement:
      return "The " + matches + " keypoints that look alike do not agree on where the object is.";
    case TpsRansacFailure::kDegenerate:
      return "The keypoints that agree lie on one line, so they do not show how the object bends.";
    case TpsRansacFailure::kFolded:
      return "The keypoints that agree would fold the object over itself.";
  }
  return "";
}

auto PointsOf(const Features& query, const Features& reference,
              const std::vector<MatchedPair>& inliers) {
  decltype(Explanation::inliers) points;
  points.reserve(inliers.size());
  for (const MatchedPair& pair : inliers) {
    const Keypoint& q = query.keypoints[pair.query];
    const Keypoint& r = reference.keypoints[pair.reference];
    points.push_back({{q.x, q.y}, {r.x, r.y}});
  }
  return points;
}

}  // namespace

Explanation Explain(const Features& query, const Features& reference,
                    const VerificationResult& result) {
  Explanation explanation;
  explanation.verified = result.verified();
  explanation.failure = FailureInWords(result);
  explanation.matches = result.matches;
  explanation.inlier_fraction = result.inlier_fraction;
  explanation.independent_inliers = result.independent;
  explanation.colour_difference = result.colour_difference;
  explanation.reference_width = reference.width;
  explanation.reference_height = reference.height;
  explanation.inliers = PointsOf(query, reference, result.inliers);
  if (result.warp) {
    explanation.mesh = WarpMesh(*result.warp, reference.width, reference.height);
  }
  return explanation;
}

std::vector<Explanation> ExplainInstances(const Features& query, const Features& reference,
                                          const VerificationResult& result) {
  std::vector<Explanation> explanations = {Explain(query, reference, result)};
  for (const FurtherInstance& other : result.others) {
    Explanation explanation = explanations.front();
    explanation.inlier_fraction =
        std::min(1.0, static_cast<double>(other.inliers.size()) / std::max(1, result.matches));
    explanation.independent_inliers = other.independent;
    explanation.colour_difference = other.colour_difference;
    explanation.inliers = PointsOf(query, reference, other.inliers);
    explanation.mesh = WarpMesh(other.warp, reference.width, reference.height);
    explanations.push_back(std::move(explanation));
  }
  return explanations;
}

}  // namespace pliant
