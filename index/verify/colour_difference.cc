// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/colour_difference.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "descriptor/warp/tps_ransac.h"
#include "index/verify/constants.h"
#include "index/verify/warp_geometry.h"

namespace pliant {
namespace {

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

// Chroma of the same point of the object, + 128.
struct ColourPair {
  Vec2 query;
  Vec2 reference;
};

// Means of squares of twice as many `spacings` around the points of the mesh that both images show;
// none if these are fewer than a warp needs.
std::vector<ColourPair> ColourPairs(const Features& query, const Features& reference,
                                    const Mesh& mesh, std::span<const Vec2> seen, double scale,
                                    double spacings) {
  std::vector<ColourPair> pairs;
  if (query.colours.empty() || reference.colours.empty() || seen.size() < 3) return pairs;
  const double radius =
      spacings * std::max(reference.width, reference.height) / std::max(mesh.columns, mesh.rows);
  const std::vector<Vec2> part = Enlarged(seen, kVerify.around_seen);
  const Colours in_query(query);
  const Colours in_reference(reference);
  for (int row = 0; row < mesh.rows; ++row) {
    for (int column = 0; column < mesh.columns; ++column) {
      const auto i = static_cast<std::size_t>(row * mesh.columns + column);
      const Vec2 r = mesh.reference_point(column, row);
      const Vec2 q = mesh.points[i];
      if (!mesh.trusted[i] || q.x < 0 || q.y < 0 || q.x > query.width - 1 ||
          q.y > query.height - 1 || !IsInside(r, part)) {
        continue;
      }
      pairs.push_back({in_query.Around(q, radius * scale), in_reference.Around(r, radius)});
    }
  }
  if (std::ssize(pairs) < TpsRansacOptions().min_inliers) pairs.clear();
  return pairs;
}

// The median of query - gain x reference, which comes from the light.
Vec2 Light(const std::vector<ColourPair>& pairs, double gain) {
  std::vector<double> a;
  std::vector<double> b;
  for (const ColourPair& pair : pairs) {
    a.push_back(pair.query.x - gain * pair.reference.x);
    b.push_back(pair.query.y - gain * pair.reference.y);
  }
  return {Median(std::move(a)), Median(std::move(b))};
}

double MeanDistance(const std::vector<ColourPair>& pairs, double gain) {
  const Vec2 light = Light(pairs, gain);
  double sum = 0;
  for (const auto& [q, r] : pairs) {
    sum += std::hypot(q.x - gain * r.x - light.x, q.y - gain * r.y - light.y);
  }
  return sum / static_cast<double>(pairs.size());
}

// Of the chroma of the query per chroma of the reference.
double Gain(const std::vector<ColourPair>& pairs) {
  const auto n = static_cast<double>(pairs.size());
  Vec2 mean;
  for (const auto& [q, r] : pairs) mean = {mean.x + r.x / n, mean.y + r.y / n};
  double both = 0;
  double square = n * kVerify.chroma_noise * kVerify.chroma_noise;  // noise is not enlarged
  for (const auto& [q, r] : pairs) {
    const Vec2 d{r.x - mean.x, r.y - mean.y};
    both += d.x * q.x + d.y * q.y;  // all d sum up to 0
    square += d.x * d.x + d.y * d.y;
  }
  return std::max(kVerify.least_gain, both / square);
}

}  // namespace

std::optional<double> ColourDifference(const Features& query, const Features& reference,
                                       const Mesh& mesh, std::span<const Vec2> seen, double scale) {
  const auto pairs = ColourPairs(query, reference, mesh, seen, scale, 1);
  if (pairs.empty()) return std::nullopt;
  return MeanDistance(pairs, 1);
}

std::optional<double> RelativeColourDifference(const Features& query, const Features& reference,
                                               const Mesh& mesh, std::span<const Vec2> seen,
                                               double scale) {
  const auto pairs = ColourPairs(query, reference, mesh, seen, scale, 0.5);
  if (pairs.empty()) return std::nullopt;
  const double gain = Gain(pairs);
  double strength = 0;
  for (const ColourPair& pair : pairs) {
    strength += std::hypot(pair.reference.x - 128, pair.reference.y - 128);
  }
  strength /= static_cast<double>(pairs.size());
  return MeanDistance(pairs, gain) / (kVerify.chroma_noise + gain * strength);
}

}  // namespace pliant
