// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What happens to a body: random starts, pins, winds and solids for the cloth solver.
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
  float shrink = 0.0F;     // of the radius a radian, so that a roll does not cut itself
  float max_angle = 0.0F;  // radians; beyond it the part goes on straight
  float side = 1.0F;       // 1: towards the camera (-z), -1: away from it
};

// Wraps `positions` of a flat body; an isometric map.
void WrapAround(std::vector<Eigen::Vector3f>& positions, const Wrap& wrap);

// A plan for the solver: where the body starts and what is done to it.
struct Motion {
  std::string name;
  std::vector<Eigen::Vector3f> start;
  std::vector<Wrap> wraps;  // that made `start` of the flat body, in order: a sequence shows them
  ClothOptions cloth;
  int frames = 0;      // of 1/60 s until the pose
  bool rigid = false;  // nothing to simulate: the start is the pose
};

// Draws a motion that suits the kind of body. `strength` in (0, 1]: how far it goes.
Motion DrawMotion(const Body& body, Random& random, float strength);

// Hardly deformed: the reference view of an object.
Motion DrawCalmMotion(const Body& body, Random& random);

// Runs the solver. Throws Error kInternal "simulation_diverged".
Pose Perform(const Body& body, const Motion& motion);

// Runs the solver and keeps `count` poses, `frames_between` frames apart, the first at once. The
// wraps of a motion happen first, over two thirds of the poses.
std::vector<Pose> PerformSequence(const Body& body, const Motion& motion, int count,
                                  int frames_between);

}  // namespace pliant::simulation
