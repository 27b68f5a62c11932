// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/warp_geometry.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include "descriptor/base/error.h"
#include "index/verify/constants.h"

namespace pliant {
namespace {

constexpr int kOutlinePointsASide = 8;
constexpr int kMostPointsASide = 256;

bool Touch(Vec2 a, Vec2 b, Vec2 c, Vec2 d) {
  const double abc = Cross(a, b, c);
  const double abd = Cross(a, b, d);
  const double cda = Cross(c, d, a);
  const double cdb = Cross(c, d, b);
  return abc * abd <= 0 && cda * cdb <= 0 && (abc != 0 || abd != 0);
}

}  // namespace

std::vector<Vec2> PointsOf(const std::vector<Keypoint>& keypoints,
                           const std::vector<MatchedPair>& pairs,
                           std::uint32_t MatchedPair::* which) {
  std::vector<Vec2> points;
  points.reserve(pairs.size());
  for (const MatchedPair& pair : pairs) {
    const Keypoint& k = keypoints[pair.*which];
    points.push_back({k.x, k.y});
  }
  return points;
}

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

std::vector<Vec2> Enlarged(std::span<const Vec2> polygon, double factor) {
  Vec2 centre;
  for (const Vec2 p : polygon) {
    centre.x += p.x / static_cast<double>(polygon.size());
    centre.y += p.y / static_cast<double>(polygon.size());
  }
  std::vector<Vec2> enlarged;
  for (const Vec2 p : polygon) {
    enlarged.push_back(
        {centre.x + factor * (p.x - centre.x), centre.y + factor * (p.y - centre.y)});
  }
  return enlarged;
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

bool HalfInside(std::span<const Vec2> points, std::span<const Vec2> polygon) {
  const auto inside = std::ranges::count_if(points, [&](Vec2 p) { return IsInside(p, polygon); });
  return 2 * inside >= std::ssize(points);
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

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double LocalScale(const ThinPlateSpline& warp, Vec2 p) {
  const auto [a, b, c, d] = warp.Jacobian(p);
  const double determinant = a * d - b * c;
  return determinant > 0 ? std::sqrt(determinant) : -1;
}

std::vector<Vec2> WarpFrame(const ThinPlateSpline& warp, int width, int height) {
  const Vec2 corners[] = {{0, 0}, {width - 1.0, 0}, {width - 1.0, height - 1.0}, {0, height - 1.0}};
  std::vector<Vec2> outline;
  for (int side = 0; side < 4; ++side) {
    const Vec2 a = corners[side];
    const Vec2 b = corners[(side + 1) % 4];
    for (int k = 0; k < kOutlinePointsASide; ++k) {
      const double t = static_cast<double>(k) / kOutlinePointsASide;
      outline.push_back(warp({a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)}));
    }
  }
  return outline;
}

Mesh WarpMesh(const ThinPlateSpline& query_from_reference, int reference_width,
              int reference_height, int longer_side) {
  if (reference_width < 2 || reference_height < 2) {
    throw Error(ErrorCode::kInvalidArgument, "bad_mesh",
                "a mesh needs a reference image of 2 x 2 pixels or more, not " +
                    std::to_string(reference_width) + " x " + std::to_string(reference_height));
  }
  if (longer_side < 2 || longer_side > kMostPointsASide) {
    throw Error(ErrorCode::kInvalidArgument, "bad_mesh",
                "the longer side of a mesh must have 2 to " + std::to_string(kMostPointsASide) +
                    " points, not " + std::to_string(longer_side));
  }
  const double cell =
      (std::max(reference_width, reference_height) - 1.0) / (longer_side - 1);  // pixels
  const auto points_on = [&](int side) {
    return std::max(2, 1 + static_cast<int>(std::lround((side - 1) / cell)));
  };
  Mesh mesh{points_on(reference_width),
            points_on(reference_height),
            reference_width,
            reference_height,
            {},
            {}};
  std::vector<double> scales;
  for (int row = 0; row < mesh.rows; ++row) {
    for (int column = 0; column < mesh.columns; ++column) {
      const Vec2 p = mesh.reference_point(column, row);
      mesh.points.push_back(query_from_reference(p));
      scales.push_back(LocalScale(query_from_reference, p));
    }
  }
  std::vector<double> positive = scales;
  std::erase_if(positive, [](double scale) { return !(scale > 0); });
  const double median = positive.empty() ? 0 : Median(std::move(positive));
  for (const double scale : scales) {
    mesh.trusted.push_back(scale > 0 && scale <= median * kVerify.max_scale_factor &&
                           scale * kVerify.max_scale_factor >= median);
  }
  return mesh;
}

}  // namespace pliant
