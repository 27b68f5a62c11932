// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/warp/local_affine.h"

#include <cmath>
#include <cstddef>

namespace pliant {
namespace {

constexpr double kLeastWidthRatio = 1.0 / 12;
constexpr double kLeastWidthPx = 0.5;

}  // namespace

std::optional<LocalAffine> FitLocalAffine(std::span<const Vec2> reference,
                                          std::span<const Vec2> query) {
  const auto n = static_cast<double>(reference.size());
  if (reference.size() < 3 || query.size() != reference.size()) return std::nullopt;
  LocalAffine map;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    map.reference.x += reference[i].x / n;
    map.reference.y += reference[i].y / n;
    map.query.x += query[i].x / n;
    map.query.y += query[i].y / n;
  }
  double xx = 0, xy = 0, yy = 0;          // of the reference
  double ux = 0, uy = 0, vx = 0, vy = 0;  // query (u, v) by reference (x, y)
  for (std::size_t i = 0; i < reference.size(); ++i) {
    const double x = reference[i].x - map.reference.x;
    const double y = reference[i].y - map.reference.y;
    const double u = query[i].x - map.query.x;
    const double v = query[i].y - map.query.y;
    xx += x * x, xy += x * y, yy += y * y;
    ux += u * x, uy += u * y, vx += v * x, vy += v * y;
  }
  // Eigenvalues of the scatter: squared length and width of the neighbourhood, times n.
  const double mean = (xx + yy) / 2;
  const double spread = std::hypot((xx - yy) / 2, xy);
  const double narrow = mean - spread;
  if (narrow < kLeastWidthRatio * kLeastWidthRatio * (mean + spread) ||
      narrow < kLeastWidthPx * kLeastWidthPx * n) {
    return std::nullopt;
  }
  const double determinant = xx * yy - xy * xy;
  // Least squares about the centroids, where the translation drops out:
  // [a b; c d] = [ux uy; vx vy] [xx xy; xy yy]^-1.
  map.a = (ux * yy - uy * xy) / determinant;
  map.b = (uy * xx - ux * xy) / determinant;
  map.c = (vx * yy - vy * xy) / determinant;
  map.d = (vy * xx - vx * xy) / determinant;
  return map;
}

bool IsPlausible(double a, double b, double c, double d, double max_anisotropy) {
  const double determinant = a * d - b * c;
  if (!(determinant > 0)) return false;
  // s1^2 + s2^2 = sum of squares, s1 s2 = determinant: s1 / s2 + s2 / s1 = sum / determinant.
  const double sum = a * a + b * b + c * c + d * d;
  return sum <= determinant * (max_anisotropy + 1 / max_anisotropy);
}

}  // namespace pliant
