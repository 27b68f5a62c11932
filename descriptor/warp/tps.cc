// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/warp/tps.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>

#include <Eigen/Dense>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

using Matrix = Eigen::MatrixXd;

// The narrow side of a set of points that spans the plane, as a share of its long side.
constexpr double kLeastWidth = 1e-3;

// rho(r) = r^2 log r = s / 2 log s with s = r^2.
double Rho(double s) { return s > 0 ? 0.5 * s * std::log(s) : 0; }

[[noreturn]] void Refuse(const char* reason, const std::string& message) {
  throw Error(ErrorCode::kInvalidArgument, reason, message);
}

[[noreturn]] void Degenerate(const std::string& why) {
  throw Error(ErrorCode::kUnprocessable, "tps_degenerate",
              "A thin-plate spline needs 3 points that are not on one line; " + why + ".");
}

void Validate(std::span<const Vec2> from, std::span<const Vec2> to, const TpsOptions& options,
              std::span<const double> weights) {
  if (from.size() != to.size() || (!weights.empty() && weights.size() != from.size())) {
    Refuse("tps_sizes_differ",
           "A thin-plate spline needs as many points (and weights) on both "
           "sides.");
  }
  if (!(options.regularization >= 0) || !std::isfinite(options.regularization)) {
    Refuse("bad_regularization", "regularization must be 0 or more.");
  }
  if (options.max_control_points < 3) {
    Refuse("bad_max_control_points", "max_control_points must be 3 or more.");
  }
  for (std::size_t i = 0; i < from.size(); ++i) {
    const bool finite = std::isfinite(from[i].x) && std::isfinite(from[i].y) &&
                        std::isfinite(to[i].x) && std::isfinite(to[i].y) &&
                        (weights.empty() || (std::isfinite(weights[i]) && weights[i] >= 0));
    if (!finite) {
      Refuse("tps_not_finite",
             "Point or weight " + std::to_string(i) + " is not a finite number (or below 0).");
    }
  }
}

// Weighted mean and inverse spread, for coordinates of unit size.
void Normalization(std::span<const Vec2> points, const std::vector<double>& weights, Vec2* centre,
                   double* scale) {
  double total = 0;
  Vec2 mean;
  for (std::size_t i = 0; i < points.size(); ++i) {
    total += weights[i];
    mean.x += weights[i] * points[i].x;
    mean.y += weights[i] * points[i].y;
  }
  mean = {mean.x / total, mean.y / total};
  double spread = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    spread += weights[i] * (std::pow(points[i].x - mean.x, 2) + std::pow(points[i].y - mean.y, 2));
  }
  spread = std::sqrt(spread / total);
  *centre = mean;
  *scale = spread > 0 ? 1 / spread : 1;
}

Vec2 Scaled(Vec2 p, Vec2 centre, double scale) {
  return {(p.x - centre.x) * scale, (p.y - centre.y) * scale};
}

// Points far from each other: each next one is the farthest from those chosen, starting at the
// one farthest from the centre. Ends early when only copies are left.
std::vector<Vec2> SpreadOut(const std::vector<Vec2>& points, std::size_t count) {
  std::vector<Vec2> chosen;
  std::vector<double> nearest(points.size(), std::numeric_limits<double>::infinity());
  Vec2 from{0, 0};
  std::vector<double> start(points.size());
  std::transform(points.begin(), points.end(), start.begin(),
                 [&](Vec2 p) { return SquaredDistance(p, from); });
  auto next =
      static_cast<std::size_t>(std::max_element(start.begin(), start.end()) - start.begin());
  while (chosen.size() < count) {
    chosen.push_back(points[next]);
    for (std::size_t i = 0; i < points.size(); ++i) {
      nearest[i] = std::min(nearest[i], SquaredDistance(points[i], points[next]));
    }
    const auto farthest = std::max_element(nearest.begin(), nearest.end());
    if (*farthest <= 1e-12) break;  // copies
    next = static_cast<std::size_t>(farthest - nearest.begin());
  }
  return chosen;
}

void CheckSpansPlane(const std::vector<Vec2>& points, const std::vector<double>& weights) {
  double xx = 0;
  double xy = 0;
  double yy = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (weights[i] <= 0) continue;
    xx += weights[i] * points[i].x * points[i].x;
    xy += weights[i] * points[i].x * points[i].y;
    yy += weights[i] * points[i].y * points[i].y;
    ++count;
  }
  if (count < 3) Degenerate(std::to_string(count) + " given");
  // Eigenvalues of the scatter: squared length and width.
  const double mean = (xx + yy) / 2;
  const double spread = std::hypot((xx - yy) / 2, xy);
  if (mean <= 0 || mean - spread < kLeastWidth * kLeastWidth * (mean + spread)) {
    Degenerate("these are on one line, or one point");
  }
}

Matrix AffineRows(const std::vector<Vec2>& points) {
  Matrix P(points.size(), 3);
  for (std::size_t i = 0; i < points.size(); ++i) P.row(i) << 1, points[i].x, points[i].y;
  return P;
}

Matrix Kernel(const std::vector<Vec2>& rows, const std::vector<Vec2>& columns) {
  Matrix K(rows.size(), columns.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (std::size_t j = 0; j < columns.size(); ++j) {
      K(i, j) = Rho(SquaredDistance(rows[i], columns[j]));
    }
  }
  return K;
}

}  // namespace

// The weights w must not move the affine part: P' w = 0 at the centres. With Z an orthonormal basis
// of that space, w = Z v, and (v, a) minimise
//   sum_i weight_i |K_i Z v + P_i a - y_i|^2 + lambda sum(weight) v' Z' K_c Z v,
// where Z' K_c Z, the bending energy, is positive definite.
ThinPlateSpline ThinPlateSpline::Fit(std::span<const Vec2> from, std::span<const Vec2> to,
                                     const TpsOptions& options, std::span<const double> weights) {
  Validate(from, to, options, weights);
  std::vector<double> w(weights.begin(), weights.end());
  if (w.empty()) w.assign(from.size(), 1.0);
  if (std::count_if(w.begin(), w.end(), [](double x) { return x > 0; }) < 3) {
    Degenerate("fewer given");
  }
  ThinPlateSpline f;
  Normalization(from, w, &f.from_centre_, &f.from_scale_);
  Normalization(to, w, &f.to_centre_, &f.to_scale_);
  std::vector<Vec2> points;
  std::vector<Vec2> carriers;  // points of weight, which may carry a basis function
  Matrix Y(from.size(), 2);
  for (std::size_t i = 0; i < from.size(); ++i) {
    points.push_back(Scaled(from[i], f.from_centre_, f.from_scale_));
    if (w[i] > 0) carriers.push_back(points.back());
    const Vec2 y = Scaled(to[i], f.to_centre_, f.to_scale_);
    Y.row(i) << y.x, y.y;
  }
  CheckSpansPlane(points, w);
  f.centres_ = SpreadOut(carriers, static_cast<std::size_t>(options.max_control_points));

  const auto m = static_cast<Eigen::Index>(f.centres_.size());
  const Matrix Pc = AffineRows(f.centres_);
  const Matrix Q = Pc.householderQr().householderQ();
  const Matrix Z = Q.rightCols(m - 3);
  Matrix B(points.size(), m);  // [K Z, P]
  B << Kernel(points, f.centres_) * Z, AffineRows(points);
  const Eigen::Map<const Eigen::VectorXd> W(w.data(), static_cast<Eigen::Index>(w.size()));
  Matrix normal = B.transpose() * W.asDiagonal() * B;
  const Matrix bending = Z.transpose() * Kernel(f.centres_, f.centres_) * Z;
  // The least share keeps points on top of each other, or next to it, from making it singular.
  const double lambda = std::max(options.regularization, 1e-10) * W.sum();
  normal.topLeftCorner(m - 3, m - 3) += lambda * bending;
  const Matrix U = normal.ldlt().solve(B.transpose() * (W.asDiagonal() * Y));
  if (!U.allFinite()) Degenerate("these are too close to it");

  const Matrix V = U.topRows(m - 3);
  const Matrix weight = Z * V;
  for (Eigen::Index k = 0; k < m; ++k) f.weights_.push_back({weight(k, 0), weight(k, 1)});
  for (int k = 0; k < 3; ++k) f.affine_[k] = {U(m - 3 + k, 0), U(m - 3 + k, 1)};
  f.bending_energy_ = (V.transpose() * bending * V).trace();
  return f;
}

Vec2 ThinPlateSpline::operator()(Vec2 p) const {
  const Vec2 q = Scaled(p, from_centre_, from_scale_);
  Vec2 y{affine_[0].x + affine_[1].x * q.x + affine_[2].x * q.y,
         affine_[0].y + affine_[1].y * q.x + affine_[2].y * q.y};
  for (std::size_t k = 0; k < centres_.size(); ++k) {
    const double rho = Rho(SquaredDistance(q, centres_[k]));
    y.x += rho * weights_[k].x;
    y.y += rho * weights_[k].y;
  }
  return {y.x / to_scale_ + to_centre_.x, y.y / to_scale_ + to_centre_.y};
}

std::array<double, 4> ThinPlateSpline::Jacobian(Vec2 p) const {
  const Vec2 q = Scaled(p, from_centre_, from_scale_);
  std::array<double, 4> j = {affine_[1].x, affine_[2].x, affine_[1].y, affine_[2].y};
  for (std::size_t k = 0; k < centres_.size(); ++k) {
    const double s = SquaredDistance(q, centres_[k]);
    if (s <= 0) continue;                  // d (r^2 log r) / dr = 0 there
    const double slope = std::log(s) + 1;  // d rho / dx = (2 log r + 1) (x - c)
    const double dx = slope * (q.x - centres_[k].x);
    const double dy = slope * (q.y - centres_[k].y);
    j[0] += dx * weights_[k].x;
    j[1] += dy * weights_[k].x;
    j[2] += dx * weights_[k].y;
    j[3] += dy * weights_[k].y;
  }
  for (double& d : j) d *= from_scale_ / to_scale_;
  return j;
}

}  // namespace pliant
