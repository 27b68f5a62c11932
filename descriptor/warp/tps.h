// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Thin-plate spline of the plane with regularisation (Bookstein 1989; Wahba 1990).
#pragma once

#include <array>
#include <span>
#include <vector>

namespace pliant {

// A point of an image, in pixels; pixel centres at integers.
struct Vec2 {
  double x = 0;
  double y = 0;
  bool operator==(const Vec2&) const = default;
};

struct TpsOptions {
  // Weight of the bending energy relative to the mean squared error, in coordinates scaled to unit
  // spread (so it does not depend on the image's size). 0 = the best fit that the control points
  // allow; large = affine.
  double regularization = 1e-3;
  // Up to this number m of points, each point has a basis function: the exact smoothing spline. For
  // n > m points, a well-spread subset of m points has them, and all n are fitted by least squares:
  // O(n m^2) instead of O(n^3).
  int max_control_points = 48;
};

// f(p) = A (1, x, y) + sum_k w_k rho(|p - c_k|), rho(r) = r^2 log r, in each coordinate.
// Immutable, thread-safe, a few kilobytes.
class ThinPlateSpline {
 public:
  // Fits f(from[i]) = to[i] with weights[i] (all 1 when empty). Throws kUnprocessable
  // "tps_degenerate" for fewer than 3 points with weight or for points on one line;
  // kInvalidArgument when sizes differ, a value is not finite, or an option is out of range.
  static ThinPlateSpline Fit(std::span<const Vec2> from, std::span<const Vec2> to,
                             const TpsOptions& options = {}, std::span<const double> weights = {});

  Vec2 operator()(Vec2 p) const;

  // d f / d p, row-major: {dfx/dx, dfx/dy, dfy/dx, dfy/dy}.
  std::array<double, 4> Jacobian(Vec2 p) const;

  // Integral of the squared second derivatives over the plane, in scaled coordinates: 0 = affine.
  double bending_energy() const { return bending_energy_; }

 private:
  ThinPlateSpline() = default;

  Vec2 from_centre_;
  double from_scale_ = 1;  // scaled = (p - centre) * scale
  Vec2 to_centre_;
  double to_scale_ = 1;
  std::vector<Vec2> centres_;        // scaled
  std::vector<Vec2> weights_;        // one per centre
  std::array<Vec2, 3> affine_ = {};  // of 1, x, y
  double bending_energy_ = 0;
};

inline double SquaredDistance(Vec2 a, Vec2 b) {
  return (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y);
}

// Twice the signed area of the triangle, positive when a, b, c turn from the x axis to the y axis.
inline double Cross(Vec2 a, Vec2 b, Vec2 c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

}  // namespace pliant
