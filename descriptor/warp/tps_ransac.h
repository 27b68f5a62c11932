// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Finds the correspondences that fit one smooth warp of a bent surface, and the warp.
//
// Random samples of three neighbouring correspondences give affine maps. These approximate a smooth
// warp locally (Tran et al., "In defence of RANSAC for outlier rejection in deformable
// registration", ECCV 2012). The best maps are extended to neighbouring correspondences that the
// map of their own neighbourhood predicts. A regularised thin-plate spline is fitted robustly to
// the largest extended set, and all correspondences are tested against it. This needs no majority
// of correct correspondences, only one region in which several neighbours are correct.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "descriptor/warp/tps.h"

namespace pliant {

// The local approximation of a smooth warp: q = query + [a b; c d] (p - reference).
struct LocalAffine {
  Vec2 reference;
  Vec2 query;
  double a = 1, b = 0, c = 0, d = 1;

  Vec2 operator()(Vec2 p) const {
    const double x = p.x - reference.x;
    const double y = p.y - reference.y;
    return {query.x + a * x + b * y, query.y + c * x + d * y};
  }
  double determinant() const { return a * d - b * c; }
};

// Least-squares fit to 3 or more corresponding points. nullopt if the reference points are nearly
// collinear (width below 1/12 of their length, or below half a pixel).
std::optional<LocalAffine> FitLocalAffine(std::span<const Vec2> reference,
                                          std::span<const Vec2> query);

// Whether [a b; c d] can be a view of a bent surface: no reflection, and a ratio of its singular
// values of at most `max_anisotropy`.
bool IsPlausible(double a, double b, double c, double d, double max_anisotropy);

struct Correspondence {
  Vec2 reference;         // pixels of the reference image
  Vec2 query;             // pixels of the query image
  double size_ratio = 0;  // keypoint size in the query / in the reference; 0 = unknown
};

struct TpsRansacOptions {
  std::uint64_t seed = 1;
  int iterations = 1500;    // samples of three, at most
  double tolerance_px = 4;  // in the query image, between a point and its mapped partner
  // The same in the reference image. If the warp shrinks the reference there, tolerance_px shrinks
  // to this times the warp's local scale, but not below least_tolerance_px. 0: it does not shrink.
  double reference_tolerance_px = 0;
  double least_tolerance_px = 0;
  double regularization = 3e-3;  // of the final spline, see TpsOptions
  double max_anisotropy = 6;     // of local maps, see IsPlausible
  // The keypoints' size ratio may differ from the warp's local scale by this factor.
  double max_size_factor = 2;
  int min_inliers = 5;  // fewer inliers are attributed to chance
};

// The largest distance between a point and its mapped partner, in pixels of the query image, where
// the warp scales areas by `determinant`.
double ToleranceAt(const TpsRansacOptions& options, double determinant);

// Throws kInvalidArgument for an option out of range, which it names, and for numbers that are not
// finite.
void Validate(std::span<const Correspondence> input, const TpsRansacOptions& options);

// Why there is no warp.
enum class TpsRansacFailure {
  kNone,
  kTooFew,       // fewer than min_inliers correspondences were given
  kNoAgreement,  // no neighbourhood has a common map, or the extended set is too small
  kDegenerate,   // the inliers lie on a line
  kFolded,       // the spline folds over at every regularisation
};
const char* ToString(TpsRansacFailure failure);

struct TpsRansacResult {
  TpsRansacFailure failure = TpsRansacFailure::kTooFew;
  std::vector<std::uint32_t> inliers;   // positions in the input, ascending; empty on failure
  std::optional<ThinPlateSpline> warp;  // reference -> query; none on failure
};

// Deterministic for a seed. Throws kInvalidArgument for options out of range or coordinates that
// are not finite; too few, collinear or contradictory correspondences are no error, but a
// `failure`. Cost: about O(n^2 + 20 iterations + n m^2) with m control points. Thread-safe.
TpsRansacResult TpsRansac(std::span<const Correspondence> correspondences,
                          const TpsRansacOptions& options = {});

}  // namespace pliant
