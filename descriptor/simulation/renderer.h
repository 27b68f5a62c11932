// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Renders surfaces, lights and a camera to an image with its ground truth.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "descriptor/simulation/random.h"
#include "descriptor/simulation/surface.h"

namespace pliant::simulation {

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

// A pinhole camera: x right, y down, z forward; pixel centres are at integers.
struct Camera {
  int width = 640;
  int height = 480;
  float focal_px = 800.0F;
  float centre_x = 319.5F;
  float centre_y = 239.5F;
  Eigen::Matrix3f rotation = Eigen::Matrix3f::Identity();          // camera from body
  Eigen::Vector3f translation = Eigen::Vector3f(0.0F, 0.0F, 2.F);  // camera from body

  Eigen::Vector3f ToCamera(const Eigen::Vector3f& point) const {
    return rotation * point + translation;
  }
  Eigen::Vector3f Position() const { return -(rotation.transpose() * translation); }
  // Pixel position of a point in camera coordinates with z > 0.
  Eigen::Array2f Project(const Eigen::Vector3f& in_camera) const {
    return {focal_px * in_camera.x() / in_camera.z() + centre_x,
            focal_px * in_camera.y() / in_camera.z() + centre_y};
  }
};

inline constexpr std::uint8_t kNoChart = 255;

// An image in linear light and, per pixel, the surface point at the pixel's centre.
struct Frame {
  int width = 0;
  int height = 0;
  std::vector<Colour> colour;       // height x width
  std::vector<std::uint8_t> chart;  // chart of the object's front, or kNoChart
  std::vector<std::uint16_t> uv;    // height x width x 2, 65535 = 1; 0 where there is no chart

  std::size_t At(int x, int y) const { return static_cast<std::size_t>(y) * width + x; }
};

// Share of the pixels that show the object, by their charts.
double Coverage(const std::vector<std::uint8_t>& chart);

// Draws with 2 x 2 samples per pixel over `backdrop` (height x width, or empty for black). Back
// faces of a chart hide surfaces behind them and count as no chart.
Frame Render(const std::vector<Surface>& surfaces, const Lighting& lighting, const Camera& camera,
             const std::vector<Colour>& backdrop);

}  // namespace pliant::simulation
