// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What becomes of a body by a motion.
#include <algorithm>
#include <cmath>

#include "descriptor/simulation/motion.h"

namespace pliant::simulation {
namespace {

using Eigen::Vector3f;

constexpr float kStretchTarget = 0.006F;
constexpr int kRelaxPasses = 400;

// The flat body with its wraps done as far as `share`, 0..1.
Pose PartlyWrapped(const Body& body, const Motion& motion, float share) {
  Pose pose{motion.name, body.rest, motion.cloth.solids, 0.0F};
  for (Wrap wrap : motion.wraps) {
    float reach = 0.0F;  // how much there is to wrap
    for (const Vector3f& p : pose.positions)
      reach = std::max(reach, wrap.across.dot(p.head<2>()) - wrap.offset);
    // A spiral turns a little further than a circle.
    const float turns = reach / wrap.radius * (wrap.shrink > 0.0F ? 1.15F : 1.0F);
    wrap.max_angle = std::min(wrap.max_angle, turns);
    wrap.max_angle *= share * share * (3.0F - 2.0F * share);  // starts and ends slowly
    WrapAround(pose.positions, wrap);
  }
  pose.stretch_p95 = StretchQuantile(body, pose.positions, 0.95F);
  return pose;
}

Pose Finish(const Body& body, Cloth& cloth, const Motion& motion) {
  cloth.Relax(kStretchTarget, kRelaxPasses);
  const std::vector<Vector3f> positions = cloth.positions();
  return {motion.name, positions, motion.cloth.solids, StretchQuantile(body, positions, 0.95F)};
}

}  // namespace

void WrapAround(std::vector<Vector3f>& positions, const Wrap& wrap) {
  const auto& [across, offset, radius, shrink, max_angle, side] = wrap;
  for (Vector3f& p : positions) {
    const float s = across.dot(p.head<2>()) - offset;
    if (s <= 0.0F) continue;
    // Arc length of the spiral r = radius - shrink * t, to first order in shrink.
    const float reach = std::max(0.0F, radius * radius - 2.0F * shrink * s);
    const float t = shrink > 0.0F ? (radius - std::sqrt(reach)) / shrink : s / radius;
    const float angle = std::min(t, max_angle);
    const float r = radius - shrink * angle;
    const float used = radius * angle - 0.5F * shrink * angle * angle;
    const float beyond = std::max(0.0F, s - used);
    const float along = r * std::sin(angle) + beyond * std::cos(angle);
    const float up = radius - r * std::cos(angle) + beyond * std::sin(angle);
    p.head<2>() += across * (along - s);
    p.z() -= side * up;
  }
}

Pose Perform(const Body& body, const Motion& motion) {
  return PerformSequence(body, motion, 1, 0).front();
}

std::vector<Pose> PerformSequence(const Body& body, const Motion& motion, int count,
                                  int frames_between) {
  std::vector<Pose> poses;
  if (motion.rigid) {
    const Pose pose{motion.name, motion.start, motion.cloth.solids,
                    StretchQuantile(body, motion.start, 0.95F)};
    poses.assign(static_cast<std::size_t>(count), pose);
    return poses;
  }
  const int wrapping = motion.wraps.empty() || count == 1 ? 0 : count * 2 / 3;
  for (int i = 0; i < wrapping; ++i) {
    poses.push_back(
        PartlyWrapped(body, motion, static_cast<float>(i) / static_cast<float>(wrapping)));
  }
  Cloth cloth(body, motion.start, motion.cloth);
  if (count == 1) cloth.Run(motion.frames);
  for (int i = wrapping; i < count; ++i) {
    if (i > 0) cloth.Run(frames_between);
    Cloth snapshot = cloth;
    poses.push_back(Finish(body, snapshot, motion));
  }
  return poses;
}

}  // namespace pliant::simulation
