// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/truth_scene.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <Eigen/Core>
#include <Eigen/LU>

#include "descriptor/base/error.h"

namespace pliant::evaluation {
namespace {

using Matrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

std::optional<Vec2> Apply(const Homography& h, Vec2 p) {
  const double w = h[6] * p.x + h[7] * p.y + h[8];
  const Vec2 mapped{(h[0] * p.x + h[1] * p.y + h[2]) / w, (h[3] * p.x + h[4] * p.y + h[5]) / w};
  if (!std::isfinite(mapped.x) || !std::isfinite(mapped.y)) return std::nullopt;
  return mapped;
}

Homography Inverse(const Homography& h, std::size_t view) {
  const Matrix matrix = Eigen::Map<const Matrix>(h.data());
  const double size = matrix.norm();
  const double determinant = matrix.determinant();
  if (!matrix.allFinite() || !(std::abs(determinant) > 1e-15 * size * size * size)) {
    throw Error(ErrorCode::kInvalidArgument, "homography_singular",
                "the homography to image " + std::to_string(view + 1) +
                    " has no inverse; it needs nine finite numbers, row by row");
  }
  Homography inverse;
  Eigen::Map<Matrix>(inverse.data()) = matrix.inverse();
  return inverse;
}

using Coordinates = std::array<float, 3>;

constexpr std::size_t kLeaf = 12;
constexpr float kLabelSpacing = 1e7F;  // more than any two coordinates differ
constexpr double kMaxStepPx = 1.0;
constexpr double kMaxFirstStepPx = 2.0;
// Sides whose slopes differ by more than this factor do not belong to one smooth surface.
constexpr double kSmoothFactor = 3.0;

Coordinates Difference(const Coordinates& a, const Coordinates& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

double Dot(const Coordinates& a, const Coordinates& b) {
  return static_cast<double>(a[0]) * b[0] + static_cast<double>(a[1]) * b[1] +
         static_cast<double>(a[2]) * b[2];
}

const SurfacePoint* SameSurface(const SurfaceMap& map, int x, int y, std::uint32_t label) {
  if (x < 0 || y < 0 || x >= map.width || y >= map.height) return nullptr;
  const SurfacePoint& point = map.Pixel(x, y);
  return point.label == label ? &point : nullptr;
}

std::optional<Coordinates> SlopeAlong(const SurfaceMap& map, int x, int y, int dx, int dy) {
  const SurfacePoint& here = map.Pixel(x, y);
  const SurfacePoint* before = SameSurface(map, x - dx, y - dy, here.label);
  const SurfacePoint* after = SameSurface(map, x + dx, y + dy, here.label);
  if (before == nullptr && after == nullptr) return std::nullopt;
  if (before == nullptr) return Difference(after->at, here.at);
  if (after == nullptr) return Difference(here.at, before->at);
  const Coordinates forward = Difference(after->at, here.at);
  const Coordinates backward = Difference(here.at, before->at);
  const double ahead = std::sqrt(Dot(forward, forward));
  const double behind = std::sqrt(Dot(backward, backward));
  if (ahead > kSmoothFactor * behind) return backward;
  if (behind > kSmoothFactor * ahead) return forward;
  return Coordinates{0.5F * (forward[0] + backward[0]), 0.5F * (forward[1] + backward[1]),
                     0.5F * (forward[2] + backward[2])};
}

// From a pixel's centre to where `point` is, by least squares on the local slopes.
std::optional<Vec2> StepTo(const SurfaceMap& map, int x, int y, const SurfacePoint& point) {
  const std::optional<SurfaceSlope> slope = SlopeAt(map, x, y);
  if (!slope) return std::nullopt;
  const Coordinates wanted = Difference(point.at, map.Pixel(x, y).at);
  const double xx = Dot(slope->x, slope->x);
  const double xy = Dot(slope->x, slope->y);
  const double yy = Dot(slope->y, slope->y);
  const double determinant = xx * yy - xy * xy;
  if (!(determinant > 1e-9 * xx * yy)) return std::nullopt;
  const double bx = Dot(slope->x, wanted);
  const double by = Dot(slope->y, wanted);
  return Vec2{(yy * bx - xy * by) / determinant, (xx * by - xy * bx) / determinant};
}

bool Within(Vec2 step, double limit) {
  return std::abs(step.x) <= limit && std::abs(step.y) <= limit;
}

}  // namespace

std::uint32_t SurfaceMap::LabelAt(Vec2 p) const {
  // Not by a cast first: far-away values do not fit an int.
  if (!Contains(FrameOf(width, height), p.x, p.y)) return 0;
  return Pixel(static_cast<int>(std::floor(p.x + 0.5)), static_cast<int>(std::floor(p.y + 0.5)))
      .label;
}

std::optional<SurfacePoint> SurfaceMap::Locate(Vec2 p) const {
  if (LabelAt(p) == 0) return std::nullopt;
  const int x = static_cast<int>(std::floor(p.x + 0.5));
  const int y = static_cast<int>(std::floor(p.y + 0.5));
  SurfacePoint point = Pixel(x, y);
  const auto right = static_cast<float>(p.x - x);
  const auto down = static_cast<float>(p.y - y);
  if (const std::optional<SurfaceSlope> slope = SlopeAt(*this, x, y)) {
    for (std::size_t c = 0; c < 3; ++c) point.at[c] += right * slope->x[c] + down * slope->y[c];
  }
  return point;
}

std::optional<SurfaceSlope> SlopeAt(const SurfaceMap& map, int x, int y) {
  const std::optional<Coordinates> along_x = SlopeAlong(map, x, y, 1, 0);
  const std::optional<Coordinates> along_y = SlopeAlong(map, x, y, 0, 1);
  if (!along_x || !along_y) return std::nullopt;
  return SurfaceSlope{*along_x, *along_y};
}

SurfaceIndex::SurfaceIndex(const SurfaceMap& map, float max_distance)
    : map_(map), max_distance_(max_distance) {
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const SurfacePoint& point = map.points[i];
    if (point.label == 0) continue;
    entries_.push_back(
        {{point.at[0], point.at[1], point.at[2], kLabelSpacing * static_cast<float>(point.label)},
         static_cast<std::uint32_t>(i)});
  }
  axis_.resize(entries_.size());
  Build(0, entries_.size());
}

void SurfaceIndex::Build(std::size_t begin, std::size_t end) {
  if (end - begin <= kLeaf) return;
  std::array<float, 4> low = entries_[begin].key;
  std::array<float, 4> high = low;
  for (std::size_t i = begin + 1; i < end; ++i) {
    for (std::size_t c = 0; c < 4; ++c) {
      low[c] = std::min(low[c], entries_[i].key[c]);
      high[c] = std::max(high[c], entries_[i].key[c]);
    }
  }
  std::size_t widest = 0;
  for (std::size_t c = 1; c < 4; ++c) {
    if (high[c] - low[c] > high[widest] - low[widest]) widest = c;
  }
  const std::size_t middle = begin + (end - begin) / 2;
  const auto at = [&](std::size_t i) { return entries_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(begin), at(middle), at(end), [widest](const Entry& a, const Entry& b) {
    return a.key[widest] < b.key[widest];
  });
  axis_[middle] = static_cast<std::uint8_t>(widest);
  Build(begin, middle);
  Build(middle + 1, end);
}

void SurfaceIndex::Search(std::size_t begin, std::size_t end, const std::array<float, 4>& key,
                          Nearest& nearest) const {
  const auto consider = [&](const Entry& entry) {
    float squared = 0;
    for (std::size_t c = 0; c < 4; ++c)
      squared += (entry.key[c] - key[c]) * (entry.key[c] - key[c]);
    if (squared < nearest.squared_distance) nearest = {squared, entry.pixel};
  };
  if (end - begin <= kLeaf) {
    for (std::size_t i = begin; i < end; ++i) consider(entries_[i]);
    return;
  }
  const std::size_t middle = begin + (end - begin) / 2;
  const float offset = key[axis_[middle]] - entries_[middle].key[axis_[middle]];
  consider(entries_[middle]);
  const auto search = [&](bool before) {
    before ? Search(begin, middle, key, nearest) : Search(middle + 1, end, key, nearest);
  };
  search(offset < 0);
  if (offset * offset < nearest.squared_distance) search(offset >= 0);
}

std::optional<Vec2> SurfaceIndex::Find(const SurfacePoint& point) const {
  if (entries_.empty() || point.label == 0) return std::nullopt;
  Nearest nearest{std::numeric_limits<float>::infinity(), 0};
  Search(0, entries_.size(),
         {point.at[0], point.at[1], point.at[2], kLabelSpacing * static_cast<float>(point.label)},
         nearest);
  if (nearest.squared_distance > max_distance_ * max_distance_) return std::nullopt;
  const auto columns = static_cast<std::uint32_t>(map_.width);
  int x = static_cast<int>(nearest.pixel % columns);
  int y = static_cast<int>(nearest.pixel / columns);
  if (map_.Pixel(x, y).label != point.label) return std::nullopt;
  std::optional<Vec2> step = StepTo(map_, x, y, point);
  if (!step || !Within(*step, kMaxFirstStepPx)) return std::nullopt;
  // Where the surface is seen aslant, the pixel nearest in coordinates may not be the nearest one.
  const int right = static_cast<int>(std::lround(step->x));
  const int down = static_cast<int>(std::lround(step->y));
  if ((right != 0 || down != 0) && SameSurface(map_, x + right, y + down, point.label) != nullptr) {
    const std::optional<Vec2> again = StepTo(map_, x + right, y + down, point);
    if (again && Within(*again, kMaxStepPx)) {
      x += right;
      y += down;
      step = again;
    }
  }
  if (!Within(*step, kMaxStepPx)) return std::nullopt;
  const Vec2 found{x + step->x, y + step->y};
  if (!Contains(FrameOf(map_.width, map_.height), found.x, found.y)) return std::nullopt;
  return found;
}

void SurfaceScene::Add(Image grey, SurfaceMap map) {
  auto view = std::make_unique<View>();
  view->image = std::move(grey);
  view->map = std::move(map);
  views_.push_back(std::move(view));
}

std::optional<Vec2> SurfaceScene::Map(int from, Vec2 p, int to) {
  const std::optional<SurfacePoint> point = At(from).map.Locate(p);
  if (!point) return std::nullopt;
  View& target = At(to);
  if (!target.index) target.index = std::make_unique<SurfaceIndex>(target.map, max_distance_);
  return target.index->Find(*point);
}

HomographyScene::HomographyScene(std::vector<Image> images,
                                 const std::vector<Homography>& from_first)
    : images_(std::move(images)), from_first_(from_first) {
  if (images_.size() != from_first_.size()) {
    throw Error(ErrorCode::kInvalidArgument, "homography_count",
                "there must be as many homographies as images");
  }
  for (std::size_t k = 0; k < from_first_.size(); ++k)
    to_first_.push_back(Inverse(from_first_[k], k));
}

std::optional<Vec2> HomographyScene::Map(int from, Vec2 p, int to) {
  const std::optional<Vec2> flat = Apply(to_first_[static_cast<std::size_t>(from)], p);
  if (!flat) return std::nullopt;
  const std::optional<Vec2> mapped = Apply(from_first_[static_cast<std::size_t>(to)], *flat);
  if (!mapped) return std::nullopt;
  const Image& image = ViewImage(to);
  const bool inside = Contains(FrameOf(image.width, image.height), mapped->x, mapped->y);
  return inside ? mapped : std::nullopt;
}

}  // namespace pliant::evaluation
