// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/motion.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace pliant::simulation {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

// Wraps the motion's start and remembers how.
void WrapStart(Motion& motion, const Wrap& wrap) {
  WrapAround(motion.start, wrap);
  motion.wraps.push_back(wrap);
}

void Shake(std::vector<Vector3f>& positions, Random& random, float amount) {
  for (Vector3f& p : positions) p.z() += amount * random.Normal();
}

Vector2f PlanarDirection(Random& random) {
  const float turn = random.Angle();
  return {std::cos(turn), std::sin(turn)};
}

Solid Table(float z, float friction) {
  Solid table;
  table.kind = SolidKind::kTable;
  table.centre = Vector3f(0.0F, 0.0F, z);
  table.friction = friction;
  return table;
}

float DrawBendCompliance(Random& random) { return random.LogUniform(3e-6F, 3e-3F); }

// Pins the particle and its neighbours within `radius` on the flat cloth, all with one velocity.
void PinPatch(const Body& body, int centre, float radius, const Pin& like, std::vector<Pin>& pins) {
  for (std::size_t i = 0; i < body.rest.size(); ++i) {
    if ((body.rest[i] - body.rest[centre]).norm() > radius) continue;
    const auto taken = [i](const Pin& pin) { return pin.particle == static_cast<int>(i); };
    if (std::ranges::any_of(pins, taken)) continue;
    Pin pin = like;
    pin.particle = static_cast<int>(i);
    pins.push_back(pin);
  }
}

int RandomParticle(const Chart& chart, Random& random) {
  for (;;) {
    const int particle =
        chart.particle[random.Integer(0, static_cast<int>(chart.particle.size()) - 1)];
    if (particle >= 0) return particle;
  }
}

// A corner, the middle of an edge, or the centre.
int NotablePoint(const Chart& chart, Random& random) {
  for (;;) {
    const int column = random.Integer(0, 2) * (chart.columns - 1) / 2;
    const int row = random.Integer(0, 2) * (chart.rows - 1) / 2;
    if (chart.At(column, row) >= 0) return chart.At(column, row);
  }
}

// A motion that begins with the undeformed body, shaken a little out of its plane.
Motion Start(const Body& body, std::string name, Random& random, float shake) {
  Motion motion;
  motion.name = std::move(name);
  motion.start = body.rest;
  Shake(motion.start, random, shake);
  return motion;
}

// Held at a few points that come together a little, in wind and gravity of any direction.
Motion Flutter(const Body& body, Random& random, float strength) {
  Motion motion = Start(body, "flutter", random, 0.004F);
  motion.frames = random.Integer(40, 75);
  const float duration = motion.frames / 60.0F;
  const int count = random.Integer(1, 4);
  for (int i = 0; i < count; ++i) {
    const int point = random.Chance(0.8F) ? NotablePoint(body.charts[0], random)
                                          : RandomParticle(body.charts[0], random);
    Pin pin;
    pin.velocity = -body.rest[point] * (strength * random.Uniform(0.0F, 0.45F) / duration) +
                   random.Normal3() * (0.06F * strength / duration);
    PinPatch(body, point, body.spacing * random.Uniform(0.5F, 2.2F), pin, motion.cloth.pins);
  }
  motion.cloth.gravity = random.Direction() * random.Uniform(0.3F, 2.5F) * strength;
  motion.cloth.wind = Wind(random, strength * random.Uniform(0.8F, 3.0F));
  motion.cloth.drag = random.Uniform(1.0F, 4.0F);
  motion.cloth.bend_compliance = DrawBendCompliance(random);
  motion.cloth.self_collision = random.Chance(0.3F);
  return motion;
}

Solid RandomSolid(Random& random) {
  Solid solid;
  solid.kind = static_cast<SolidKind>(random.Integer(0, 2));
  solid.axes = Eigen::AngleAxisf(random.Angle(), Vector3f::UnitZ()).toRotationMatrix();
  const float size = random.Uniform(0.08F, 0.28F);
  solid.size = Vector3f(size, size * random.Uniform(0.6F, 3.0F), size * random.Uniform(0.5F, 1.2F));
  if (solid.kind == SolidKind::kBox) {
    const Vector3f tilt = random.Direction();
    solid.axes =
        Eigen::AngleAxisf(random.Uniform(0.0F, 0.5F), tilt).toRotationMatrix() * solid.axes;
  }
  solid.centre = Vector3f(random.Uniform(-0.3F, 0.3F), random.Uniform(-0.3F, 0.3F), 0.0F);
  solid.friction = random.Uniform(0.2F, 0.8F);
  return solid;
}

// Falls on one to three solids that stand on a table; gravity points away from the camera.
Motion Drape(const Body& body, Random& random, float strength) {
  Motion motion = Start(body, "drape", random, 0.003F);
  motion.frames = random.Integer(45, 75);
  const int count = random.Integer(1, 3);
  float depth = 0.1F;
  for (int i = 0; i < count; ++i) {
    Solid solid = RandomSolid(random);
    solid.size *= 0.5F + 0.5F * strength;
    const float reach = solid.kind == SolidKind::kBox ? solid.size.z() : solid.size.x();
    solid.centre.z() = reach + random.Uniform(0.02F, 0.12F);
    depth = std::max(depth, solid.centre.z() + random.Uniform(0.3F, 1.0F) * reach);
    motion.cloth.solids.push_back(solid);
  }
  motion.cloth.solids.push_back(Table(depth, random.Uniform(0.3F, 0.8F)));
  motion.cloth.gravity = Vector3f(0.0F, 0.0F, random.Uniform(2.5F, 5.0F));
  motion.cloth.wind = Wind(random, 0.4F * strength);
  motion.cloth.bend_compliance = DrawBendCompliance(random);
  motion.cloth.damping = 2.0F;
  motion.cloth.self_collision = true;
  return motion;
}

// Lies on a table with a part folded over, or rolled up.
Motion FoldOrRoll(const Body& body, Random& random, float strength) {
  Motion motion;
  const bool roll = random.Chance(0.35F);
  motion.name = roll ? "roll" : "fold";
  motion.start = body.rest;
  const Chart& chart = body.charts[0];
  const Vector2f across = PlanarDirection(random);
  const float extent =
      0.5F * (std::abs(across.x()) * chart.width + std::abs(across.y()) * chart.height);
  const float radius = roll ? random.Uniform(0.05F, 0.12F) : random.Uniform(0.018F, 0.08F);
  const float angle = roll ? random.Uniform(1.0F, 3.0F) * kPi * (0.4F + 0.6F * strength)
                           : random.Uniform(0.4F, 1.0F) * kPi;
  const float shrink = roll ? 0.2F * radius / (2.0F * kPi) : 0.0F;
  WrapStart(motion, {across, extent * random.Uniform(-0.1F, 0.75F), radius, shrink, angle, 1.0F});
  if (random.Chance(0.4F)) {
    WrapStart(motion, {-across, extent * random.Uniform(0.2F, 0.8F), radius, shrink,
                       random.Uniform(0.2F, 0.9F) * kPi, random.Chance(0.7F) ? 1.0F : -1.0F});
  }
  Shake(motion.start, random, 0.003F);
  motion.frames = random.Integer(10, 30);
  motion.cloth.gravity = Vector3f(0.0F, 0.0F, random.Uniform(0.5F, 3.0F));
  motion.cloth.solids.push_back(
      Table(0.02F + (motion.cloth.gravity.z() > 1.5F ? 0.0F : 0.05F), 0.7F));
  motion.cloth.wind = Wind(random, strength * random.Uniform(0.0F, 1.2F));
  motion.cloth.bend_compliance = random.LogUniform(3e-6F, 3e-4F);
  motion.cloth.damping = 3.0F;
  motion.cloth.self_collision = true;
  return motion;
}

// Grabbed at several points that are pulled together, then let go; on a table or in the air.
Motion Crumple(const Body& body, Random& random, float strength) {
  Motion motion = Start(body, "crumple", random, 0.006F);
  const int pull = random.Integer(22, 36);
  const int rest = random.Integer(4, 25);
  motion.frames = pull + rest;
  const float duration = pull / 60.0F;
  const bool table = random.Chance(0.6F);
  const int count = random.Integer(3, 8);
  for (int i = 0; i < count; ++i) {
    const int point = RandomParticle(body.charts[0], random);
    Vector3f to = -body.rest[point] * (strength * random.Uniform(0.1F, 0.6F)) +
                  random.Normal3() * (0.08F * strength);
    to.z() = -std::abs(to.z()) * random.Uniform(0.2F, 1.2F);
    Pin pin;
    pin.velocity = to / duration;
    pin.until_s = duration;
    pin.release = table || i > 0;
    PinPatch(body, point, body.spacing * random.Uniform(0.5F, 1.6F), pin, motion.cloth.pins);
  }
  motion.cloth.gravity = table ? Vector3f(0.0F, 0.0F, random.Uniform(1.0F, 3.0F))
                               : Vector3f(random.Direction() * 0.8F);
  if (table) motion.cloth.solids.push_back(Table(0.01F, 0.8F));
  motion.cloth.wind = Wind(random, strength * random.Uniform(0.2F, 1.0F));
  motion.cloth.bend_compliance = DrawBendCompliance(random);
  motion.cloth.damping = 3.0F;
  motion.cloth.self_collision = true;
  return motion;
}

// A stiff sheet, bent around one or two lines, hardly moving: paper, card, a magazine.
Motion Bend(const Body& body, Random& random, float strength) {
  Motion motion;
  motion.name = "bend";
  motion.start = body.rest;
  const Vector2f across = PlanarDirection(random);
  const float angle = strength * random.Uniform(0.5F, 3.2F);
  WrapStart(motion, {across, random.Uniform(-0.35F, 0.1F), random.Uniform(0.12F, 0.5F), 0.0F, angle,
                     random.Chance(0.5F) ? 1.0F : -1.0F});
  if (random.Chance(0.6F)) {
    WrapStart(motion, {-across, random.Uniform(-0.1F, 0.3F), random.Uniform(0.12F, 0.5F), 0.0F,
                       strength * random.Uniform(0.3F, 2.4F), random.Chance(0.5F) ? 1.0F : -1.0F});
  }
  Shake(motion.start, random, 0.002F);
  motion.frames = random.Integer(6, 16);
  motion.cloth.wind = Wind(random, strength * random.Uniform(0.0F, 2.5F));
  motion.cloth.bend_compliance = random.LogUniform(1e-6F, 1e-4F);
  motion.cloth.gravity = random.Direction() * 0.5F;
  motion.cloth.damping = 2.0F;
  return motion;
}

// Tubes: a rigid can or bottle, or a sleeve that is held at some points and pulled.
Motion Sleeve(const Body& body, Random& random, float strength) {
  Motion motion;
  if (random.Chance(0.35F)) {
    motion.name = "can";
    motion.start = body.rest;
    motion.rigid = true;
    return motion;
  }
  motion = Crumple(body, random, 0.5F * strength);
  motion.name = "sleeve";
  motion.cloth.solids.clear();
  motion.cloth.gravity = random.Direction() * random.Uniform(0.0F, 0.8F);
  motion.cloth.pressure = random.Uniform(0.0F, 3.0F);
  motion.cloth.bend_compliance = random.LogUniform(1e-6F, 1e-4F);
  motion.cloth.self_collision = false;
  return motion;
}

// Pillows and bags: blown up, grabbed, perhaps lying on a table.
Motion Squeeze(const Body& body, Random& random, float strength) {
  Motion motion = Crumple(body, random, 0.55F * strength);
  motion.name = "squeeze";
  motion.cloth.pressure = random.LogUniform(1.0F, 12.0F);
  motion.cloth.self_collision = false;
  for (Solid& solid : motion.cloth.solids) solid.centre.z() = 0.15F;
  return motion;
}

Motion Wear(const Body& body, Random& random, float strength) {
  Motion motion = random.Chance(0.5F) ? Flutter(body, random, 0.7F * strength)
                                      : Crumple(body, random, 0.6F * strength);
  motion.name = "wear";
  motion.cloth.pressure = random.Uniform(0.3F, 2.0F);
  motion.cloth.self_collision = false;
  return motion;
}

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

Motion DrawMotion(const Body& body, Random& random, float strength) {
  switch (body.kind) {
    case BodyKind::kTube:
      return Sleeve(body, random, strength);
    case BodyKind::kPillow:
      return Squeeze(body, random, strength);
    case BodyKind::kShirt:
      return Wear(body, random, strength);
    case BodyKind::kSheet:
      break;
  }
  const float draw = random.Uniform();
  if (draw < 0.34F) return Flutter(body, random, strength);
  if (draw < 0.50F) return Drape(body, random, strength);
  if (draw < 0.66F) return FoldOrRoll(body, random, strength);
  if (draw < 0.82F) return Crumple(body, random, strength);
  return Bend(body, random, strength);
}

Motion DrawCalmMotion(const Body& body, Random& random) {
  Motion motion;
  motion.name = "calm";
  motion.start = body.rest;
  if (body.kind == BodyKind::kSheet) {
    const Vector2f across = PlanarDirection(random);
    WrapStart(motion, {across, random.Uniform(-0.3F, 0.2F), random.Uniform(1.0F, 4.0F), 0.0F, 0.5F,
                       random.Chance(0.5F) ? 1.0F : -1.0F});
  }
  motion.rigid = body.kind == BodyKind::kSheet || body.kind == BodyKind::kTube;
  motion.frames = 40;
  motion.cloth.damping = 3.0F;
  motion.cloth.pressure = body.kind == BodyKind::kPillow ? 1.2F : 0.5F;
  return motion;
}

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
    poses.push_back(PartlyWrapped(body, motion, static_cast<float>(i) / wrapping));
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
