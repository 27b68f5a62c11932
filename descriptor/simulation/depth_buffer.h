// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A z-buffer of triangle numbers. Larger values are nearer (1 / z for a camera, -depth for a
// parallel light), because those are linear over the picture.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace pliant::simulation {

class DepthBuffer {
 public:
  DepthBuffer(int width, int height) : width_(width), height_(height) {
    const auto count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    nearness_.assign(count, -std::numeric_limits<float>::max());
    triangle_.assign(count, -1);
  }

  int width() const { return width_; }
  int height() const { return height_; }
  std::int32_t triangle(int x, int y) const { return triangle_[Index(x, y)]; }
  float nearness(int x, int y) const { return nearness_[Index(x, y)]; }

  // Corners are sample positions (sample centres at integers) with their nearness. Spans run from
  // ceil to ceil, so triangles that share an edge neither overlap nor leave a gap. `keep(x, y)` is
  // called for each sample that passes the depth test and may reject it.
  template <typename Keep>
  void Draw(const std::array<Eigen::Array2f, 3>& corner, const std::array<float, 3>& near,
            std::int32_t id, Keep&& keep);
  void Draw(const std::array<Eigen::Array2f, 3>& corner, const std::array<float, 3>& near,
            std::int32_t id) {
    Draw(corner, near, id, [](int, int) { return true; });
  }

 private:
  std::size_t Index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }

  int width_, height_;
  std::vector<float> nearness_;
  std::vector<std::int32_t> triangle_;
};

template <typename Keep>
void DepthBuffer::Draw(const std::array<Eigen::Array2f, 3>& corner,
                       const std::array<float, 3>& near, std::int32_t id, Keep&& keep) {
  const Eigen::Array2f e1 = corner[1] - corner[0];
  const Eigen::Array2f e2 = corner[2] - corner[0];
  const float area = e1.x() * e2.y() - e2.x() * e1.y();
  if (!(std::abs(area) > 1e-12F)) return;
  const float slope_x = ((near[1] - near[0]) * e2.y() - (near[2] - near[0]) * e1.y()) / area;
  const float slope_y = ((near[2] - near[0]) * e1.x() - (near[1] - near[0]) * e2.x()) / area;
  // Sorted from top to bottom.
  std::array<int, 3> order{0, 1, 2};
  if (corner[1].y() < corner[0].y()) std::swap(order[0], order[1]);
  if (corner[static_cast<std::size_t>(order[2])].y() <
      corner[static_cast<std::size_t>(order[1])].y())
    std::swap(order[1], order[2]);
  if (corner[static_cast<std::size_t>(order[1])].y() <
      corner[static_cast<std::size_t>(order[0])].y())
    std::swap(order[0], order[1]);
  const Eigen::Array2f top = corner[static_cast<std::size_t>(order[0])];
  const Eigen::Array2f middle = corner[static_cast<std::size_t>(order[1])];
  const Eigen::Array2f bottom = corner[static_cast<std::size_t>(order[2])];
  const auto limit = [](float value, int high) {
    return static_cast<int>(std::ceil(std::clamp(value, 0.0F, static_cast<float>(high))));
  };
  const int y_end = limit(bottom.y(), height_);
  const auto at = [](const Eigen::Array2f& a, const Eigen::Array2f& b, float y) {
    return a.x() + (b.x() - a.x()) * ((y - a.y()) / (b.y() - a.y()));
  };
  for (int y = limit(top.y(), height_); y < y_end; ++y) {
    const auto fy = static_cast<float>(y);
    const float long_side = at(top, bottom, fy);
    const float short_side = fy < middle.y() ? at(top, middle, fy) : at(middle, bottom, fy);
    const auto [left, right] = std::minmax(long_side, short_side);
    const int x_end = limit(right, width_);
    const int x_begin = limit(left, width_);
    float* row_near = nearness_.data() + Index(0, y);
    std::int32_t* row_id = triangle_.data() + Index(0, y);
    const float base = near[0] + slope_y * (fy - corner[0].y()) - slope_x * corner[0].x();
    for (int x = x_begin; x < x_end; ++x) {
      const float value = base + slope_x * static_cast<float>(x);
      if (value <= row_near[x] || !keep(x, y)) continue;
      row_near[x] = value;
      row_id[x] = id;
    }
  }
}

}  // namespace pliant::simulation
