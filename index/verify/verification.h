// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Is the object of a data-base picture really in the query picture, however it is bent? Mutual
// nearest neighbours that pass the ratio test must agree with one smooth warp.
#pragma once

#include <optional>
#include <vector>

#include "descriptor/features/features.h"
#include "descriptor/match/matching.h"
#include "descriptor/warp/tps.h"
#include "descriptor/warp/tps_ransac.h"
#include "index/records/location.h"

namespace pliant {

struct VerificationOptions {
  // Of a query descriptor's distances to its two nearest in the reference (Lowe 2004). The
  // reference shows its object once, the query may show it several times.
  float max_ratio = 0.9F;
  // How far a match may lie from where the warp puts it, as a share of the query picture's longer
  // side (0.01 of 640 pixels: 6.4 pixels).
  double tolerance = 0.01;
  TpsRansacOptions ransac = {};  // tolerance_px is set from `tolerance`
  int max_instances = 1;         // of the object that are looked for in the query; at least 1
  int threads = 1;               // for the matching of one pair; 0 = all cores
};

// The object once more, elsewhere in the query picture.
struct FurtherInstance {
  std::vector<MatchedPair> inliers;
  ThinPlateSpline warp;  // reference picture -> query picture
  std::vector<Vec2> outline;
};

struct VerificationResult {
  int matches = 0;                                       // tentative: mutual, within the ratio
  std::vector<MatchedPair> inliers;                      // those that agree with the warp
  double inlier_fraction = 0;                            // inliers / matches; 0 without matches
  TpsRansacFailure failure = TpsRansacFailure::kTooFew;  // kNone when there is a warp
  std::optional<ThinPlateSpline> warp;  // reference picture -> query picture, in pixels
  // Outline of the object in the query picture, in order, not closed: the frame of the reference
  // picture through the warp, or the convex hull of the inliers where the frame does not map
  // sanely. Empty without a warp.
  std::vector<Vec2> outline;
  std::vector<FurtherInstance> others;  // most inliers first; with max_instances above 1

  bool verified() const { return warp.has_value(); }
};

// A query that is verified against many candidates. Immutable and thread-safe: give each thread
// candidates of its own, with options.threads 1. `query` must outlive it.
//
// The object is first looked for among mutual nearest neighbours. Then, if more instances are
// wanted, what is left of the query (nothing within the outlines found, no inliers) is matched
// without asking for mutuality, since one point of the reference may be seen many times. A further
// instance needs twice the inliers that the first does, and must show a part of the reference that
// an earlier one shows: what shows another part is the same instance, bent beyond one smooth warp.
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
  void FindFurther(const Features& reference, const std::vector<Match>& matches,
                   VerificationResult* result) const;
  std::vector<Correspondence> Correspondences(const Features& reference,
                                              const std::vector<Match>& matches) const;

  const Features& query_;
  VerificationOptions options_;
};

// How sure verification is of a picture: min(20, max(0, inliers - 4) inlier_fraction). The fraction
// is in it because a picture with many matches has some that agree by chance or on the background;
// and evidence ends at 20, because by then the object is there and the words tell better which
// picture is more like the query.
double Evidence(int inliers, double inlier_fraction);

// The final score of a hit. Evidence e lifts the ranking's score towards 1, and never lowers it:
//   score + (1 - score) e / (e + 10).
// Hits without evidence keep their score and so their order; e = 10 goes half of the way to 1.
double LiftScore(double ranking_score, double evidence);
double CombineScores(double ranking_score, int inliers, double inlier_fraction);

}  // namespace pliant
