// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/solid.h"

#include <algorithm>
#include <cmath>

namespace pliant::simulation {
namespace {

using Eigen::Vector3f;

// Box with half sides `size`, rounded a little so that cloth gets a usable normal at its edges.
float BoxDistance(const Vector3f& p, const Vector3f& size, Vector3f& normal) {
  const Vector3f q = p.cwiseAbs() - size;
  if (q.maxCoeff() <= 0.0F) {
    int axis = 0;
    const float distance = q.maxCoeff(&axis);
    normal = Vector3f::Zero();
    normal[axis] = p[axis] < 0.0F ? -1.0F : 1.0F;
    return distance;
  }
  const Vector3f outside = q.cwiseMax(0.0F);
  const float distance = outside.norm();
  for (int i = 0; i < 3; ++i) normal[i] = std::copysign(outside[i] / distance, p[i]);
  return distance;
}

float CylinderDistance(const Vector3f& p, float radius, float half_length, Vector3f& normal) {
  const float across = std::hypot(p.x(), p.z());
  const float side = across - radius;
  const float cap = std::abs(p.y()) - half_length;
  const Vector3f outward =
      across > 1e-6F ? Vector3f(p.x() / across, 0.0F, p.z() / across) : Vector3f(1, 0, 0);
  const Vector3f along(0.0F, p.y() < 0.0F ? -1.0F : 1.0F, 0.0F);
  if (side > 0.0F && cap > 0.0F) {
    const float distance = std::hypot(side, cap);
    normal = (outward * side + along * cap) / distance;
    return distance;
  }
  normal = side > cap ? outward : along;
  return std::max(side, cap);
}

}  // namespace

float Solid::Distance(const Vector3f& point, Vector3f& normal) const {
  const Vector3f offset = point - centre;
  if (kind == SolidKind::kSphere) {
    const float norm = offset.norm();
    normal = norm > 1e-6F ? Vector3f(offset / norm) : Vector3f(0.0F, 0.0F, -1.0F);
    return norm - size.x();
  }
  if (kind == SolidKind::kTable) {
    normal = -axes.col(2);
    return normal.dot(offset);
  }
  const Vector3f local = axes.transpose() * offset;
  Vector3f local_normal;
  const float distance = kind == SolidKind::kBox
                             ? BoxDistance(local, size, local_normal)
                             : CylinderDistance(local, size.x(), size.y(), local_normal);
  normal = axes * local_normal;
  return distance;
}

}  // namespace pliant::simulation
