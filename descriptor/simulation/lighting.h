// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Lights, cast shadows, and the light that reaches the vertices of a surface.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "descriptor/simulation/depth_buffer.h"
#include "descriptor/simulation/random.h"
#include "descriptor/simulation/surface.h"

namespace pliant::simulation {

struct Light {
  Eigen::Vector3f position = Eigen::Vector3f(0.0F, -3.0F, -3.0F);  // body frame
  Colour colour = Colour::Ones();  // linear; at the distance of the body's origin
  bool near = false;               // falls off with the distance; otherwise like the sun
  bool casts_shadow = false;
  float softness = 0.02F;  // half width of the shadow's edge, body lengths
};

struct Lighting {
  std::vector<Light> lights;
  Colour ambient = Colour::Constant(0.3F);
  Eigen::Vector3f sky =
      Eigen::Vector3f(0.0F, -1.0F, 0.0F);  // where ambient light comes from mostly
};

// One to four lights on the camera's side of the body. `view` points from the body to the camera.
Lighting DrawLighting(Random& random, const Eigen::Vector3f& view);

// A depth map seen from a distant light.
class ShadowMap {
 public:
  ShadowMap(const Light& light, const std::vector<Surface>& surfaces);
  // The fraction of the light that reaches the point, 0..1.
  float Visible(const Eigen::Vector3f& point) const;

 private:
  Eigen::Array2f ToMap(const Eigen::Vector3f& point) const;

  Eigen::Matrix3f axes_;  // rows: right, down, along the light
  Eigen::Vector3f centre_;
  float scale_ = 1.0F;   // samples per unit
  float spread_ = 1.0F;  // samples
  DepthBuffer depth_;
};

// Per vertex: light on the front and on the back (to multiply the surface's colour) and highlight.
struct VertexLight {
  std::vector<Colour> front, back, gloss;
};
VertexLight LightVertices(const Surface& surface, const Lighting& lighting,
                          const std::vector<ShadowMap>& shadows, const Eigen::Vector3f& eye);
// One map for each light that casts shadows, in order.
std::vector<ShadowMap> MakeShadowMaps(const Lighting& lighting,
                                      const std::vector<Surface>& surfaces);

}  // namespace pliant::simulation
