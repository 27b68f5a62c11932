// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Verifies that the object of a stored image is in the query image, even if it is bent. Mutual
// nearest neighbours that pass the ratio test must fit one smooth warp.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "descriptor/features/features.h"
#include "descriptor/match/matching.h"
#include "descriptor/warp/tps.h"
#include "descriptor/warp/tps_ransac.h"
#include "index/records/explanation.h"
#include "index/records/location.h"

namespace pliant {

struct VerificationOptions {
  // Largest ratio of a query descriptor's distances to its two nearest reference descriptors (Lowe
  // 2004). The reference shows its object once; the query can show it several times.
  float max_ratio = 0.9F;
  // Largest distance of a match from its position by the warp, as a share of the query image's
  // longer side (0.01 of 640 pixels: 6.4 pixels).
  double tolerance = 0.01;
  // If the query shows the reference small, the tolerance is at most the first share of the
  // reference's longer side as the query shows it. It is at least one pixel, and the second share
  // of the longer side of the box around the query's keypoints.
  double reference_tolerance = 0.03;
  double least_tolerance = 0.004;
  TpsRansacOptions ransac = {};  // its tolerances are set from these
  int max_instances = 1;         // of the object in the query; at least 1
  int threads = 1;               // to match one pair; 0 = all cores
  // VerificationResult::distinctness comes from so many keypoints of the query, the first ones. The
  // fine details that a second pass adds after them resemble nothing. 0 = all.
  std::size_t usual_keypoints = 0;
};

// Mean and mean squared length of descriptors. The bits of binary descriptors are components of 0
// and 1, so that their squared distance is the Hamming distance.
struct DescriptorSpread {
  std::vector<double> mean;
  double squared_length = 0;
};

// One instance of the object in the query image.
struct FoundInstance {
  std::vector<MatchedPair> inliers;         // the matches that fit the warp
  std::vector<float> distances;             // of the inliers' descriptors
  double effective_inliers = 0;             // EffectiveInliers
  std::optional<double> colour_difference;  // of the visible part (colour_difference.h)
  std::optional<ThinPlateSpline> warp;      // reference image -> query image, in pixels
  // Outline of the object in the query image, in order, not closed: the frame of the reference
  // image through the warp, or the convex hull of the inliers if the frame does not map sanely.
  // Empty without a warp.
  std::vector<Vec2> outline;
};

struct VerificationResult : FoundInstance {
  int matches = 0;                                       // tentative: mutual, within the ratio
  double inlier_fraction = 0;                            // inliers / matches; 0 without matches
  TpsRansacFailure failure = TpsRansacFailure::kTooFew;  // kNone when there is a warp
  // The others, most inliers first; with max_instances above 1. The first has the most effective
  // inliers.
  std::vector<FoundInstance> others;
  // With a warp: how far the query's keypoints without an instance are from the reference's
  // descriptors: the median distance to the nearest, divided by the root mean square distance of
  // any two, relative to unrelated photos with these descriptors. About 1 for photos, down to 0 if
  // all details of the two images resemble each other.
  double distinctness = 1;
  // With a warp: share of the matches in the hull of the inliers, in the query, that are inliers.
  double agreeing = 1;

  bool verified() const { return warp.has_value(); }
};

// Verifies many candidates against one query. Immutable and thread-safe: for several threads, give
// each its own candidates, with options.threads 1. `query` must outlive it.
//
// The object is first searched for among mutual nearest neighbours. Then, if more instances are
// wanted, the remaining query keypoints (no inliers, outside the outlines found) are matched
// without mutuality, since the query can show one point of the reference many times. A further
// instance needs twice the inliers of the first. It must show a part of the reference that an
// earlier instance shows. Another part belongs to the same instance, bent beyond one smooth warp.
class Verifier {
 public:
  // Throws kInvalidArgument for options out of range or descriptors that are malformed or not
  // finite.
  explicit Verifier(const Features& query, const VerificationOptions& options = {});

  // Throws kConflict "model_mismatch" if the features come from different models, and what the
  // constructor throws for the reference. Not found is no error. Deterministic for
  // options.ransac.seed.
  VerificationResult Verify(const Features& reference) const;

 private:
  std::vector<Match> MatchesWith(const Features& reference) const;  // with any ratio
  // What decides InliersByChance: sets distinctness and agreeing. `all`: of MatchesWith; `mutual`:
  // those within the ratio.
  void MeasureChance(const Features& reference, const std::vector<Match>& all,
                     const std::vector<Match>& mutual, VerificationResult* result) const;
  void FindFurther(const Features& reference, const std::vector<Match>& matches,
                   VerificationResult* result) const;
  TpsRansacOptions RansacFor(const Features& reference) const;
  // Of a result with a warp.
  FoundInstance InstanceOf(const Features& reference, const std::vector<Match>& matches,
                           TpsRansacResult agreed, const TpsRansacOptions& ransac) const;
  std::vector<Correspondence> Correspondences(const Features& reference,
                                              const std::vector<Match>& matches) const;

  const Features& query_;
  VerificationOptions options_;
  DescriptorSpread spread_;  // of the query
};

// The keypoints that `keep` accepts, with their descriptors, in their order.
Features Subset(const Features& features, const std::function<bool(const Keypoint&)>& keep);

// The effective inlier count (Schoenberger et al., "A Vote-and-Verify Strategy for Fast Spatial
// Verification in Image Retrieval", ACCV 2016). Neighbouring inliers show the same detail and are
// correct or wrong together. Many of them lie in a small area: a common part of two objects (a map
// on every note of a series), or an edge that matches by chance. So each inlier counts 1 / n, where
// n is the number of inliers (itself included) within `query_radius` pixels of it in the query or
// within `reference_radius` in the reference. Returns the sum, from 1 to `inliers.size()`.
double EffectiveInliers(const Features& query, const Features& reference,
                        const std::vector<MatchedPair>& inliers, double query_radius,
                        double reference_radius);

// Explains why verification confirmed an image or did not: one explanation per instance; without
// instances, one with the reason.
std::vector<Explanation> ExplainInstances(const Features& query, const Features& reference,
                                          const VerificationResult& result);

}  // namespace pliant
