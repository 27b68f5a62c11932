// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Position-based dynamics of a body: XPBD (Macklin et al. 2016) in small steps (Macklin et al.
// 2019), long-range attachments to the pins (Kim et al. 2012), wind, gravity, solids with friction
// and, on request, collisions of the cloth with itself.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "descriptor/simulation/body.h"
#include "descriptor/simulation/random.h"

namespace pliant::simulation {

// Rigid bodies that cloth falls on: each is a signed distance with its outward normal.
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

// Wind: a steady part that turns slowly and three waves of random direction in space and
// time, so that neighbouring particles feel related but chaotic forces.
class Wind {
 public:
  Wind() = default;
  Wind(Random& random, float strength);
  Eigen::Vector3f At(const Eigen::Vector3f& position, float time) const;

 private:
  struct Wave {
    Eigen::Vector3f direction = Eigen::Vector3f::Zero();
    Eigen::Vector3f wave_vector = Eigen::Vector3f::Zero();
    float frequency = 0.0F;
    float phase = 0.0F;
  };
  Eigen::Vector3f steady_ = Eigen::Vector3f::Zero();
  std::array<Wave, 3> waves_;
  float strength_ = 0.0F;
};

// A constrained particle: it moves with a velocity until `until_s`, then stays fixed or is
// released.
struct Pin {
  int particle = 0;
  Eigen::Vector3f velocity = Eigen::Vector3f::Zero();
  float until_s = 1e9F;
  bool release = false;
};

struct ClothOptions {
  Eigen::Vector3f gravity = Eigen::Vector3f::Zero();  // units / s^2
  Wind wind;
  float drag = 1.5F;               // how strongly moving air pushes a particle, 1 / s
  float damping = 1.0F;            // loss of velocity, 1 / s
  float shear_compliance = 2e-6F;  // 0 = as stiff as the edges
  float bend_compliance = 1e-4F;   // 1e-6 card .. 1e-2 silk
  float pressure = 0.0F;           // pillows: acceleration along the outward normal
  float thickness = 0.006F;        // distance kept from solids
  bool self_collision = false;
  int substeps = 10;  // per 1/60 s
  std::vector<Solid> solids;
  std::vector<Pin> pins;
};

class Cloth {
 public:
  // `body` must outlive the cloth. Starts from `start` (one position per particle).
  Cloth(const Body& body, const std::vector<Eigen::Vector3f>& start, ClothOptions options);

  // Advances by `frames` of 1/60 s.
  void Run(int frames);
  // Moves particles as little as possible until the 95th percentile of the residual stretch is at
  // most `target`, or `max_passes` are spent. Releases all pins: call it on a copy if the
  // simulation is to continue.
  void Relax(float target, int max_passes);

  std::vector<Eigen::Vector3f> positions() const;
  float time_s() const { return time_s_; }

 private:
  struct Attachment {
    int pin, particle;
    float reach;
  };
  struct Contact {
    int a, b;
  };

  void BuildAttachments();
  void UpdateNormals();
  void UpdateAir();
  void FindContacts();
  void Substep(float dt);
  void MovePins(float dt);
  void SolveEdges(const std::vector<Edge>& edges, float alpha);
  void SolveAttachments();
  void SolveContacts();
  void SolveSolids();

  const Body& body_;
  ClothOptions options_;
  // The fourth value is zero: a position is one vector register.
  std::vector<Eigen::Vector4f> positions_, previous_, velocities_;
  std::vector<Eigen::Vector3f> normals_, air_;
  std::vector<float> inverse_mass_;
  std::vector<Attachment> attachments_;
  std::vector<Contact> contacts_;
  float time_s_ = 0.0F;
  float contact_distance_ = 0.0F;
};

}  // namespace pliant::simulation
