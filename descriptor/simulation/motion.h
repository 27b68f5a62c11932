// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Motions of a body: random start shapes, pins, wind and solids for the cloth solver.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "descriptor/simulation/body.h"
#include "descriptor/simulation/cloth.h"
#include "descriptor/simulation/random.h"

namespace pliant::simulation {

// A deformed body and the solids around it.
struct Pose {
  std::string motion;  // "flutter", "drape", "fold", "roll", "crumple", "bend", ...
  std::vector<Eigen::Vector3f> positions;  // one per particle
  std::vector<Solid> solids;
  float stretch_p95 = 0.0F;  // residual stretch after the solver
};

// The part of a flat body beyond a line, wrapped around a cylinder.
struct Wrap {
  Eigen::Vector2f across = Eigen::Vector2f::UnitX();  // unit normal of the line
  float offset = 0.0F;                                // of the line from the body's centre
  float radius = 0.1F;
  float shrink = 0.0F;     // of the radius per radian, so that a roll does not intersect itself
  float max_angle = 0.0F;  // radians; beyond it the part continues straight
  float side = 1.0F;       // 1: towards the camera (-z), -1: away from it
};

// Wraps `positions` of a flat body; an isometric map.
void WrapAround(std::vector<Eigen::Vector3f>& positions, const Wrap& wrap);

// Input of the solver: the start shape and the forces.
struct Motion {
  std::string name;
  std::vector<Eigen::Vector3f> start;
  std::vector<Wrap> wraps;  // from the flat body to `start`, in order; a sequence shows them
  ClothOptions cloth;
  int frames = 0;      // of 1/60 s until the pose
  bool rigid = false;  // nothing to simulate: the start is the pose
};

// Draws a motion suitable for the kind of body. `strength` in (0, 1]: amount of deformation.
Motion DrawMotion(const Body& body, Random& random, float strength);

// Almost no deformation: for the reference view of an object.
Motion DrawCalmMotion(const Body& body, Random& random);

// Runs the solver. Throws Error kInternal "simulation_diverged".
Pose Perform(const Body& body, const Motion& motion);

// Runs the solver and returns `count` poses, `frames_between` frames apart, the first at the start.
// The wraps of a motion come first and take two thirds of the poses.
std::vector<Pose> PerformSequence(const Body& body, const Motion& motion, int count,
                                  int frames_between);

}  // namespace pliant::simulation
