// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/truth_scene.h"

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

}  // namespace

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
  const bool inside = mapped->x >= -0.5 && mapped->y >= -0.5 && mapped->x < image.width - 0.5 &&
                      mapped->y < image.height - 0.5;
  return inside ? mapped : std::nullopt;
}

}  // namespace pliant::evaluation
