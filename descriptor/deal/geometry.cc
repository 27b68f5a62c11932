// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/geometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "descriptor/deal/weights.h"

namespace pliant::deal {
namespace {

constexpr int kControlStride = 4;  // every fourth row and column is a control point: 8 x 8
constexpr double kBoxScale = 0.3;  // the share of the unit square that the grid occupies

using Point = std::array<double, 2>;

double RingRadius(RadialSpacing spacing, int ring) {
  const double share = (ring + 0.5) / kPatchSide;
  return spacing == RadialSpacing::kLinear ? share : std::pow(kPatchSide, share - 1);
}

std::vector<Point> Grid(RadialSpacing spacing) {
  std::vector<Point> grid;
  grid.reserve(kPatchPixels);
  for (int i = 0; i < kPatchSide; ++i) {
    const double angle = 2 * std::numbers::pi * (i + 0.5) / kPatchSide;
    for (int j = 0; j < kPatchSide; ++j) {
      const double radius = RingRadius(spacing, j);
      grid.push_back({radius * std::cos(angle), radius * std::sin(angle)});
    }
  }
  return grid;
}

double HalfWidth() {
  double half = 0;
  for (const Point& p : Grid(RadialSpacing::kLinear)) half = std::max(half, std::abs(p[0]));
  return half;
}

std::vector<Point> InBox(std::vector<Point> points) {
  const double half = HalfWidth();
  for (Point& point : points) {
    for (double& value : point) value = (value / half + 1) / 2 * kBoxScale + (1 - kBoxScale) / 2;
  }
  return points;
}

double Rho(const Point& a, const Point& b) {
  const double squared = (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]);
  return squared * std::log(std::sqrt(squared) + 1e-6);
}

}  // namespace

std::vector<float> UnitPolarGrid(RadialSpacing spacing) {
  std::vector<float> values;
  values.reserve(2 * kPatchPixels);
  for (const Point& point : Grid(spacing)) {
    values.push_back(static_cast<float>(point[0]));
    values.push_back(static_cast<float>(point[1]));
  }
  return values;
}

std::vector<float> TpsBasis(RadialSpacing spacing) {
  const std::vector<Point> linear = InBox(Grid(RadialSpacing::kLinear));
  std::vector<Point> controls;
  for (int i = 0; i < kPatchSide; i += kControlStride) {
    for (int j = 0; j < kPatchSide; j += kControlStride) {
      controls.push_back(linear[static_cast<std::size_t>(i * kPatchSide + j)]);
    }
  }
  std::vector<float> basis;
  basis.reserve(static_cast<std::size_t>(kPatchPixels) * kTpsParameters);
  for (const Point& q : InBox(Grid(spacing))) {
    const double first = Rho(q, controls[0]);
    for (std::size_t k = 1; k < controls.size(); ++k) {
      basis.push_back(static_cast<float>(Rho(q, controls[k]) - first));
    }
    basis.insert(basis.end(), {1.0F, static_cast<float>(q[0]), static_cast<float>(q[1])});
  }
  return basis;
}

double DisplacementGain() { return 2 * HalfWidth() / kBoxScale; }

}  // namespace pliant::deal
