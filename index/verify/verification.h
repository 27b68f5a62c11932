// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Is the object of a stored image really in the query image, however it is bent? Mutual nearest
// neighbours that pass the ratio test must fit one smooth warp.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "descriptor/features/features.h"
#include "descriptor/match/matching.h"
#include "descriptor/match/stepped.h"
#include "descriptor/warp/tps.h"
#include "descriptor/warp/tps_ransac.h"
#include "index/records/explanation.h"
#include "index/records/location.h"

namespace pliant {

struct VerificationOptions {
  // Of a query descriptor's distances to its two nearest in the reference (Lowe 2004). The
  // reference shows its object once, the query may show it several times.
  float max_ratio = 0.9F;
  // How far a match may lie from where the warp puts it, as a share of the query image's longer
  // side (0.01 of 640 pixels: 6.4 pixels).
  double tolerance = 0.01;
  // Where the query shows the reference small, a share of the reference's longer side, as the query
  // shows it, is tolerated, if that is less; but at least a share of the longer side of the box
  // around the query's keypoints, and a pixel.
  double reference_tolerance = 0.03;
  double least_tolerance = 0.004;
  TpsRansacOptions ransac = {};  // its tolerances are set from these
  int max_instances = 1;         // of the object that are searched for in the query; at least 1
  int threads = 1;               // for the matching of one pair; 0 = all cores
};

// The object at one place of the query image.
struct FoundInstance {
  std::vector<MatchedPair> inliers;         // the matches that fit the warp
  std::vector<float> distances;             // of the inliers' descriptors
  double effective_inliers = 0;             // EffectiveInliers
  std::optional<double> colour_difference;  // of the part that is seen (colour_difference.h)
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
  std::vector<FoundInstance> others;  // most inliers first; with max_instances above 1

  bool verified() const { return warp.has_value(); }
};

// A query that is verified against many candidates. Immutable and thread-safe: give each thread
// candidates of its own, with options.threads 1. `query` must outlive it.
//
// The object is first searched for among mutual nearest neighbours. Then, if more instances are
// wanted, the remaining query keypoints (no inliers, outside the outlines found) are matched
// without mutuality, since one point of the reference may be seen many times. A further instance
// needs twice the inliers that the first does, and must show a part of the reference that an
// earlier one shows: another part belongs to the same instance, bent beyond one smooth warp.
class Verifier {
 public:
  // Throws kInvalidArgument for options out of range or descriptors that are malformed or not
  // finite.
  explicit Verifier(const Features& query, const VerificationOptions& options = {});

  // Throws kConflict "model_mismatch" when the features come from different models, and what the
  // constructor throws for the reference. Nothing found is no error. Deterministic for
  // options.ransac.seed.
  VerificationResult Verify(const Features& reference) const;

 private:
  std::vector<Match> MatchesWith(const Features& reference) const;
  void FindFurther(const Features& reference, const std::vector<Match>& matches,
                   VerificationResult* result) const;
  TpsRansacOptions RansacFor(const Features& reference) const;
  // Of a result with a warp.
  FoundInstance InstanceOf(const Features& reference, const std::vector<Match>& matches,
                           TpsRansacResult agreed, const TpsRansacOptions& ransac) const;
  std::vector<Correspondence> Correspondences(const Features& reference,
                                              const std::vector<Match>& matches) const;

  const Features& query_;
  std::optional<SteppedDescriptors> query_steps_;  // in the precision of the database
  VerificationOptions options_;
};

// The keypoints that `keep` accepts, with their descriptors, in their order.
Features Subset(const Features& features, const std::function<bool(const Keypoint&)>& keep);

// The effective inlier count (Schoenberger et al., "A Vote-and-Verify Strategy for Fast Spatial
// Verification in Image Retrieval", ACCV 2016). Neighbouring inliers see the same detail, and are
// right or wrong together: a part that two objects have in common (a map on every note of a
// series), or an edge that matches by chance, has many of them in a small area. So each inlier
// counts as 1 / n, n the inliers (itself included) within `query_radius` pixels of it in the query
// or within `reference_radius` in the reference. Returns the sum, from 1 to `inliers.size()`.
double EffectiveInliers(const Features& query, const Features& reference,
                        const std::vector<MatchedPair>& inliers, double query_radius,
                        double reference_radius);

// How many effective inliers a wrong image has by chance, with few exceptions: 4.5, and more for
// queries with over 2048 keypoints, up to 6 with 4096: a second pass finds twice the matches, most
// of them wrong.
double InliersByChance(std::size_t query_keypoints);

// The effective inliers beyond those by chance: `effective_inliers` - `by_chance`, but never below
// 0.25; 0 for 0, which is no warp. Of the wrong images of street photographs that have a warp at
// all, most have five effective inliers or fewer, one in 25 has more than 5.5, none of 124 had 7;
// so these move an image up among its neighbours, and no further (and see DropWeakEvidence).
double Evidence(double effective_inliers, double by_chance = 4.5);

// The final score of a hit: evidence e multiplies the odds of the ranking's score s,
//   score / (1 - score) = s / (1 - s) (1 + e)^4.
// It never lowers a score, and hits without evidence keep theirs and so their order. Ranking and
// inliers are weighed against each other at any number of inliers: between two views of similar
// objects with many of them a third more count as much as a score 3.2 times as high.
double LiftScore(double ranking_score, double evidence);

// The ranking score of an image that nothing speaks for: that of the best of a few hundred images
// that do not show the query's object. For pairs of images outside of a search.
inline constexpr double kNoResemblance = 0.002;

// The probability that a hit of the ranking by neighbours with this final score is right:
//   p / (1 - p) = 30 score / (1 - score).
// Fitted to the first hits of 323 street photographs of worn shirts, half of the time with the
// right object in the collection and half of the time without.
double Probability(double score);

// Why an image is a hit, or was not confirmed as one: an explanation of each instance; if there is
// none, one that says why.
std::vector<Explanation> ExplainInstances(const Features& query, const Features& reference,
                                          const VerificationResult& result);

}  // namespace pliant
