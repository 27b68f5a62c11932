// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/framing.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace pliant::simulation {
namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;

constexpr float kDegree = std::numbers::pi_v<float> / 180.0F;

// Mean directions of a chart's u axis and of its front, over the columns around `facing_u`.
// Rows of the result: right, down, away from the viewer of the front.
Matrix3f MeanFrame(const Body& body, const Pose& pose, float facing_u) {
  const Chart& chart = body.charts[0];
  Vector3f right = Vector3f::Zero();
  Vector3f normal = Vector3f::Zero();
  float area = 0.0F;
  for (int row = 0; row + 1 < chart.rows; ++row) {
    for (int column = 0; column + 1 < chart.columns; ++column) {
      const float u = static_cast<float>(column) / static_cast<float>(chart.columns - 1);
      if (body.kind == BodyKind::kTube && std::abs(u - facing_u) > 0.12F) continue;
      const int a = chart.At(column, row);
      const int b = chart.At(column + 1, row);
      const int c = chart.At(column, row + 1);
      if (a < 0 || b < 0 || c < 0) continue;
      const Vector3f across =
          pose.positions[static_cast<std::size_t>(b)] - pose.positions[static_cast<std::size_t>(a)];
      const Vector3f down =
          pose.positions[static_cast<std::size_t>(c)] - pose.positions[static_cast<std::size_t>(a)];
      right += across;
      normal += across.cross(down);
      area += across.norm() * down.norm();
    }
  }
  const bool on_table = std::ranges::any_of(
      pose.solids, [](const Solid& solid) { return solid.kind == SolidKind::kTable; });
  // A table is looked at from above; so is cloth that is folded so far that it has no mean side.
  if (on_table || normal.norm() < 0.2F * area) normal = Vector3f::UnitZ();
  normal.normalize();
  right -= normal * normal.dot(right);
  if (right.norm() < 1e-3F) right = normal.unitOrthogonal();
  right.normalize();
  Matrix3f frame;
  frame.row(0) = right;
  frame.row(1) = normal.cross(right);
  frame.row(2) = normal;
  return frame;
}

}  // namespace

Framing DrawFraming(Random& random, float strength) {
  Framing framing;
  framing.roll_deg = random.Uniform(0.0F, 360.0F);
  framing.tilt_deg = 60.0F * strength * std::sqrt(random.Uniform());
  framing.tilt_direction_deg = random.Uniform(0.0F, 360.0F);
  // Most views fill a good part of the picture; the ends are there too.
  framing.scale =
      random.Chance(0.7F) ? random.LogUniform(0.6F, 1.6F) : random.LogUniform(0.3F, 2.0F);
  framing.distance = random.LogUniform(1.6F, 4.5F);
  framing.shift_x = random.Uniform(-1.0F, 1.0F);
  framing.shift_y = random.Uniform(-1.0F, 1.0F);
  return framing;
}

Framing DrawFrontalFraming(Random& random) {
  Framing framing;
  framing.roll_deg = random.Uniform(-12.0F, 12.0F);
  framing.tilt_deg = random.Uniform(0.0F, 10.0F);
  framing.tilt_direction_deg = random.Uniform(0.0F, 360.0F);
  framing.scale = random.Uniform(0.85F, 0.98F);
  framing.distance = random.Uniform(2.5F, 5.0F);
  framing.shift_x = random.Uniform(-0.3F, 0.3F);
  framing.shift_y = random.Uniform(-0.3F, 0.3F);
  return framing;
}

Camera PlaceCamera(const Body& body, const Pose& pose, const Framing& framing, float facing_u,
                   int width, int height) {
  const float tilt_axis = framing.tilt_direction_deg * kDegree;
  const Matrix3f tilt = Eigen::AngleAxisf(framing.tilt_deg * kDegree,
                                          Vector3f(std::cos(tilt_axis), std::sin(tilt_axis), 0.0F))
                            .toRotationMatrix();
  const Matrix3f roll =
      Eigen::AngleAxisf(framing.roll_deg * kDegree, Vector3f::UnitZ()).toRotationMatrix();
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.rotation = roll * tilt * MeanFrame(body, pose, facing_u);
  const auto w = static_cast<float>(width);
  const auto h = static_cast<float>(height);
  const Chart& chart = body.charts[0];
  const float visible_width =
      body.kind == BodyKind::kTube ? chart.width / std::numbers::pi_v<float> : chart.width;
  const float fit = std::min(w / visible_width, h / chart.height);  // pixels a unit
  camera.focal_px = fit * framing.scale * framing.distance;
  // The middle of the body's extent goes to the picture's centre, then the shift.
  Vector3f low = Vector3f::Constant(1e9F);
  Vector3f high = -low;
  for (const Vector3f& position : pose.positions) {
    const Vector3f p = camera.rotation * position;
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const Vector3f middle = 0.5F * (low + high);
  camera.translation = -middle + Vector3f(0.0F, 0.0F, framing.distance);
  camera.centre_x = 0.5F * (w - 1.0F);
  camera.centre_y = 0.5F * (h - 1.0F);
  // A small object may go nearly to the border, a large one hang out of the picture.
  const float pixels = fit * framing.scale;
  camera.centre_x +=
      framing.shift_x * (0.4F * std::abs(w - pixels * (high.x() - low.x())) + 0.03F * w);
  camera.centre_y +=
      framing.shift_y * (0.4F * std::abs(h - pixels * (high.y() - low.y())) + 0.03F * h);
  return camera;
}

}  // namespace pliant::simulation
