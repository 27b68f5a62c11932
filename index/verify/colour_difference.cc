// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/colour_difference.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "index/verify/warp_geometry.h"

namespace pliant {
namespace {

constexpr int kPointsASide = 17;     // of the reference's longer side
constexpr std::size_t kLeast = 6;    // points
constexpr double kAroundSeen = 1.1;  // `seen`, enlarged about its centre

// Means over squares of an image.
class Colours {
 public:
  explicit Colours(const Features& features)
      : grid_(features.colours),
        cells_a_pixel_(static_cast<double>(grid_.width) / features.width) {}

  // Of the cells whose centres lie within `radius` pixels of the point in x and in y, or else of
  // the cell that it lies in.
  Vec2 Around(Vec2 p, double radius) const {
    const double x = (p.x + 0.5) * cells_a_pixel_ - 0.5;
    const double y = (p.y + 0.5) * cells_a_pixel_ - 0.5;
    const double r = radius * cells_a_pixel_;
    const int left = Inside(x - r, grid_.width);
    const int right = Inside(x + r, grid_.width);
    const int top = Inside(y - r, grid_.height);
    const int bottom = Inside(y + r, grid_.height);
    Vec2 sum;
    for (int row = top; row <= bottom; ++row) {
      for (int column = left; column <= right; ++column) {
        const auto at = 2 * (static_cast<std::size_t>(row) * static_cast<std::size_t>(grid_.width) +
                             static_cast<std::size_t>(column));
        sum.x += grid_.chroma[at];
        sum.y += grid_.chroma[at + 1];
      }
    }
    const double cells = (right - left + 1.0) * (bottom - top + 1.0);
    return {sum.x / cells, sum.y / cells};
  }

 private:
  static int Inside(double cell, int cells) {
    return std::clamp(static_cast<int>(std::lround(cell)), 0, cells - 1);
  }

  const ColourGrid& grid_;
  double cells_a_pixel_;
};

double MeanWithoutLight(const std::vector<Vec2>& differences) {
  std::vector<double> a;
  std::vector<double> b;
  for (const Vec2 d : differences) {
    a.push_back(d.x);
    b.push_back(d.y);
  }
  const Vec2 light{Median(std::move(a)), Median(std::move(b))};
  double sum = 0;
  for (const Vec2 d : differences) sum += std::hypot(d.x - light.x, d.y - light.y);
  return sum / static_cast<double>(differences.size());
}

}  // namespace

std::optional<double> ColourDifference(const Features& query, const Features& reference,
                                       const ThinPlateSpline& warp, std::span<const Vec2> seen,
                                       double scale) {
  if (query.colours.empty() || reference.colours.empty() || seen.size() < 3) return std::nullopt;
  if (reference.width < 2 || reference.height < 2) return std::nullopt;
  const Mesh mesh = WarpMesh(warp, reference.width, reference.height, kPointsASide);
  const std::vector<Vec2> part = Enlarged(seen, kAroundSeen);
  const double radius = std::max(reference.width, reference.height) / double{kPointsASide};
  const Colours in_query(query);
  const Colours in_reference(reference);
  std::vector<Vec2> differences;
  for (int row = 0; row < mesh.rows; ++row) {
    for (int column = 0; column < mesh.columns; ++column) {
      const auto i = static_cast<std::size_t>(row * mesh.columns + column);
      const Vec2 r = mesh.reference_point(column, row);
      const Vec2 q = mesh.points[i];
      if (!mesh.trusted[i] || q.x < 0 || q.y < 0 || q.x > query.width - 1 ||
          q.y > query.height - 1 || !IsInside(r, part)) {
        continue;
      }
      const Vec2 there = in_query.Around(q, radius * scale);
      const Vec2 here = in_reference.Around(r, radius);
      differences.push_back({there.x - here.x, there.y - here.y});
    }
  }
  if (differences.size() < kLeast) return std::nullopt;
  return MeanWithoutLight(differences);
}

}  // namespace pliant
