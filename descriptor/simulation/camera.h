// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A pinhole camera: x right, y down, z forward; pixel centres are at integers.
#pragma once

#include <Eigen/Core>

namespace pliant::simulation {

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

}  // namespace pliant::simulation
