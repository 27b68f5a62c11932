// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What is simulated: particles joined by distance constraints, and the charts that map textures
// onto them.
//
// The frame of a body: a flat sheet lies in z = 0, x along u (right), y along v (down), and its
// front looks towards -z, which is where the camera stands. Lengths are in units of the longer
// side of the (first) chart.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "descriptor/simulation/random.h"

namespace pliant::simulation {

// The outline of a chart that is not a rectangle: an inside/outside bitmap over (u, v).
struct Outline {
  int size = 0;                      // size x size, row-major, 1 = inside; 0 = whole rectangle
  std::vector<std::uint8_t> inside;  // v downwards

  bool empty() const { return size == 0; }
  bool Contains(float u, float v) const;
};

// A rectangular grid of vertices with texture coordinates u, v in [0, 1]: vertex (column, row) has
// u = column / (columns - 1), v = row / (rows - 1).
struct Chart {
  int columns = 0;
  int rows = 0;
  float width = 1.0F;         // physical, along u
  float height = 1.0F;        // physical, along v
  bool wraps = false;         // a tube: the last column is the first one
  std::vector<int> particle;  // rows x columns; index of a particle, -1 = no cloth there
  Outline outline;

  int At(int column, int row) const { return particle[row * columns + column]; }
};

enum class BodyKind { kSheet, kTube, kPillow, kShirt };
std::string ToString(BodyKind kind);

struct Edge {
  int a = 0;
  int b = 0;
  float rest = 0.0F;
};

struct Body {
  BodyKind kind = BodyKind::kSheet;
  std::vector<Chart> charts;
  std::vector<Eigen::Vector3f> rest;  // per particle: the undeformed shape
  // Grid neighbours, diagonal neighbours, and neighbours two apart (bending), ordered so that
  // neighbours in a list seldom share a particle.
  std::vector<Edge> structural;
  std::vector<Edge> shear;
  std::vector<Edge> bending;
  float spacing = 0.0F;  // mean length of a structural edge
};

// aspect = height / width of the texture; cells = grid cells along the longer side.
Body MakeSheet(float aspect, int cells);
// A tube whose chart goes once around; can, bottle or sleeve.
Body MakeTube(float aspect, int cells);
// Two rectangular charts (front, back) joined along all borders.
Body MakePillow(float aspect, int cells);
// Two charts with a T-shirt's outline joined along sides and shoulders.
Body MakeShirt(float aspect, int cells, Random& random);

// Residual stretch: the given quantile of |length / rest - 1| over the structural edges.
float StretchQuantile(const Body& body, const std::vector<Eigen::Vector3f>& positions,
                      float quantile);

}  // namespace pliant::simulation
