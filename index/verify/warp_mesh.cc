// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/warp_mesh.h"

#include <algorithm>
#include <cmath>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

constexpr int kMostPointsASide = 256;
// Of the local scale against its median over the mesh.
constexpr double kMaxScaleFactor = 4;

// sqrt of the Jacobian's determinant: query pixels per reference pixel; below 0 where it mirrors.
double LocalScale(const ThinPlateSpline& warp, Vec2 p) {
  const auto [a, b, c, d] = warp.Jacobian(p);
  const double determinant = a * d - b * c;
  return determinant > 0 ? std::sqrt(determinant) : -1;
}

double MedianOfPositive(std::vector<double> scales) {
  std::erase_if(scales, [](double scale) { return !(scale > 0); });
  if (scales.empty()) return 0;
  const auto middle = scales.begin() + static_cast<std::ptrdiff_t>(scales.size() / 2);
  std::nth_element(scales.begin(), middle, scales.end());
  return *middle;
}

}  // namespace

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
  const double median = MedianOfPositive(scales);
  for (const double scale : scales) {
    mesh.trusted.push_back(scale > 0 && scale <= median * kMaxScaleFactor &&
                           scale * kMaxScaleFactor >= median);
  }
  return mesh;
}

}  // namespace pliant
