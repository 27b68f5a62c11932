// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/outline.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace pliant {
namespace {

constexpr int kGrid = 8;

bool Touch(Vec2 a, Vec2 b, Vec2 c, Vec2 d) {
  const double abc = Cross(a, b, c);
  const double abd = Cross(a, b, d);
  const double cda = Cross(c, d, a);
  const double cdb = Cross(c, d, b);
  return abc * abd <= 0 && cda * cdb <= 0 && (abc != 0 || abd != 0);
}

}  // namespace

// Andrew's monotone chain.
std::vector<Vec2> ConvexHull(std::vector<Vec2> points) {
  std::sort(points.begin(), points.end(),
            [](Vec2 a, Vec2 b) { return a.x < b.x || (a.x == b.x && a.y < b.y); });
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 3) return points;
  std::vector<Vec2> hull;
  const auto add = [&](Vec2 p, std::size_t least) {
    while (hull.size() >= least + 2 && Cross(hull[hull.size() - 2], hull.back(), p) <= 0) {
      hull.pop_back();
    }
    hull.push_back(p);
  };
  for (const Vec2 p : points) add(p, 0);
  const std::size_t lower = hull.size() - 1;
  for (auto p = points.rbegin() + 1; p != points.rend(); ++p) add(*p, lower);
  hull.pop_back();  // the first point again
  return hull;
}

bool IsInside(Vec2 point, std::span<const Vec2> polygon) {
  bool inside = false;
  for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    const Vec2 a = polygon[i];
    const Vec2 b = polygon[j];
    if ((a.y > point.y) == (b.y > point.y)) continue;
    if (point.x < (b.x - a.x) * (point.y - a.y) / (b.y - a.y) + a.x) inside = !inside;
  }
  return inside;
}

bool CrossesItself(std::span<const Vec2> polygon) {
  const std::size_t n = polygon.size();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 2; j < n; ++j) {
      if (i == 0 && j == n - 1) continue;
      if (Touch(polygon[i], polygon[i + 1], polygon[j], polygon[(j + 1) % n])) return true;
    }
  }
  return false;
}

std::vector<Vec2> WarpFrame(const ThinPlateSpline& warp, int width, int height, int points_a_side) {
  const Vec2 corners[] = {{0, 0}, {width - 1.0, 0}, {width - 1.0, height - 1.0}, {0, height - 1.0}};
  std::vector<Vec2> outline;
  for (int side = 0; side < 4; ++side) {
    const Vec2 a = corners[side];
    const Vec2 b = corners[(side + 1) % 4];
    for (int k = 0; k < points_a_side; ++k) {
      const double t = static_cast<double>(k) / points_a_side;
      outline.push_back(warp({a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)}));
    }
  }
  return outline;
}

bool MapsFrameSanely(const ThinPlateSpline& warp, int width, int height, double scale,
                     double max_factor) {
  for (int r = 0; r <= kGrid; ++r) {
    for (int c = 0; c <= kGrid; ++c) {
      const Vec2 p{(width - 1.0) * c / kGrid, (height - 1.0) * r / kGrid};
      const auto [j00, j01, j10, j11] = warp.Jacobian(p);
      const double determinant = j00 * j11 - j01 * j10;
      if (!(determinant > 0)) return false;
      const double factor = std::sqrt(determinant) / scale;
      if (factor > max_factor || factor * max_factor < 1) return false;
    }
  }
  return true;
}

}  // namespace pliant
