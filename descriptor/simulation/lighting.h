// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Lights, cast shadows, and the light that reaches the vertices of a surface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "descriptor/simulation/random.h"
#include "descriptor/simulation/surface.h"

namespace pliant::simulation {

// A z-buffer of triangle numbers. Larger values are nearer (1 / z for a camera, -depth for a
// parallel light), because those are linear over the image.
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

struct Light {
  Eigen::Vector3f position = Eigen::Vector3f(0.0F, -3.0F, -3.0F);  // body frame
  Colour colour = Colour::Ones();  // linear; at the distance of the body's origin
  bool near = false;               // falls off with the distance; otherwise like the sun
  bool casts_shadow = false;
  float softness = 0.02F;  // half width of the shadow's edge, body lengths
};

struct Lighting {
  std::vector<Light> lights;
  Colour ambient = Colour::Constant(0.3F);
  Eigen::Vector3f sky =
      Eigen::Vector3f(0.0F, -1.0F, 0.0F);  // where ambient light comes from mostly
};

// One to four lights on the camera's side of the body. `view` points from the body to the camera.
Lighting DrawLighting(Random& random, const Eigen::Vector3f& view);

// A depth map seen from a distant light.
class ShadowMap {
 public:
  ShadowMap(const Light& light, const std::vector<Surface>& surfaces);
  // The fraction of the light that reaches the point, 0..1.
  float Visible(const Eigen::Vector3f& point) const;

 private:
  Eigen::Array2f ToMap(const Eigen::Vector3f& point) const;

  Eigen::Matrix3f axes_;  // rows: right, down, along the light
  Eigen::Vector3f centre_;
  float scale_ = 1.0F;   // samples per unit
  float spread_ = 1.0F;  // samples
  DepthBuffer depth_;
};

// Per vertex: light on the front and on the back (to multiply the surface's colour) and highlight.
struct VertexLight {
  std::vector<Colour> front, back, gloss;
};
VertexLight LightVertices(const Surface& surface, const Lighting& lighting,
                          const std::vector<ShadowMap>& shadows, const Eigen::Vector3f& eye);
// One map for each light that casts shadows, in order.
std::vector<ShadowMap> MakeShadowMaps(const Lighting& lighting,
                                      const std::vector<Surface>& surfaces);

}  // namespace pliant::simulation
