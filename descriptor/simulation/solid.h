// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Rigid bodies that cloth falls on: each is a signed distance with its outward normal.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace pliant::simulation {

enum class SolidKind { kSphere, kCylinder, kBox, kTable };

struct Solid {
  SolidKind kind = SolidKind::kSphere;
  Eigen::Vector3f centre = Eigen::Vector3f::Zero();
  // Columns are the solid's own axes. A cylinder runs along its y axis; a table is the half space
  // on the +z side of its centre (the camera is at -z).
  Eigen::Matrix3f axes = Eigen::Matrix3f::Identity();
  // Sphere: x = radius. Cylinder: x = radius, y = half length. Box: half sides.
  Eigen::Vector3f size = Eigen::Vector3f::Constant(0.3F);
  float friction = 0.4F;

  // Distance of a point to the surface, negative inside, and the outward normal there.
  float Distance(const Eigen::Vector3f& point, Eigen::Vector3f& normal) const;
};

}  // namespace pliant::simulation
