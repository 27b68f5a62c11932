// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/relief.h"

#include <algorithm>
#include <cmath>

#include "descriptor/simulation/canvas.h"

namespace pliant::simulation {
namespace {

constexpr int kColumns = 320;

// One family of creases: ridges along the lines on which a stretched, turned noise is one half.
struct Creases {
  Noise noise;
  float cos, sin, along, across, width, height;

  explicit Creases(Random& random) : noise(random) {
    const float turn = random.Angle();
    cos = std::cos(turn);
    sin = std::sin(turn);
    across = random.LogUniform(4.0F, 18.0F);
    along = across * random.Uniform(0.2F, 0.8F);
    width = random.Uniform(0.04F, 0.16F);
    height = random.LogUniform(0.2F, 1.0F) / across;
  }
  float At(float x, float y) const {
    const float n = noise.At((cos * x + sin * y) * along, (cos * y - sin * x) * across, 2);
    const float t = (n - 0.5F) / width;
    return height * (std::exp(-t * t) + 0.6F * n);
  }
};

}  // namespace

Relief::Relief(Random& random, float aspect, float steepness) : columns_(kColumns) {
  rows_ = std::max(8, static_cast<int>(std::lround(aspect * static_cast<float>(kColumns))));
  std::vector<Creases> families;
  const int count = random.Integer(1, 3);
  for (int i = 0; i < count; ++i) families.emplace_back(random);
  const float step = 1.0F / static_cast<float>(columns_);
  std::vector<float> height;
  height.reserve(static_cast<std::size_t>(columns_ + 1) * static_cast<std::size_t>(rows_ + 1));
  for (int y = 0; y <= rows_; ++y) {
    for (int x = 0; x <= columns_; ++x) {
      float sum = 0.0F;
      for (const Creases& family : families)
        sum += family.At(static_cast<float>(x) * step, static_cast<float>(y) * step);
      height.push_back(sum);
    }
  }
  double square = 0.0;
  slopes_.reserve(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  for (int y = 0; y < rows_; ++y) {
    for (int x = 0; x < columns_; ++x) {
      const auto at = static_cast<std::size_t>(y * (columns_ + 1) + x);
      slopes_.emplace_back(height[at + 1] - height[at],
                           height[at + static_cast<std::size_t>(columns_) + 1] - height[at]);
      square += static_cast<double>(slopes_.back().square().sum());
    }
  }
  const double mean = std::sqrt(square / static_cast<double>(slopes_.size()));
  const float scale = steepness / static_cast<float>(std::max(mean, 1e-9));
  for (Eigen::Array2f& slope : slopes_) slope = (slope * scale).min(1.5F).max(-1.5F);
}

Eigen::Array2f Relief::Slope(float u, float v) const {
  const float x = std::clamp(u, 0.0F, 1.0F) * static_cast<float>(columns_ - 1);
  const float y = std::clamp(v, 0.0F, 1.0F) * static_cast<float>(rows_ - 1);
  const int x0 = std::min(static_cast<int>(x), columns_ - 2);
  const int y0 = std::min(static_cast<int>(y), rows_ - 2);
  const float fx = x - static_cast<float>(x0);
  const float fy = y - static_cast<float>(y0);
  const Eigen::Array2f* row = slopes_.data() + static_cast<std::ptrdiff_t>(y0) * columns_ + x0;
  const Eigen::Array2f top = row[0] + fx * (row[1] - row[0]);
  row += columns_;
  return top + fy * (row[0] + fx * (row[1] - row[0]) - top);
}

}  // namespace pliant::simulation
