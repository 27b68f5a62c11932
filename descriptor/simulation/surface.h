// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Triangle meshes with texture coordinates, made from bodies and solids.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "descriptor/simulation/body.h"
#include "descriptor/simulation/cloth.h"
#include "descriptor/simulation/random.h"
#include "descriptor/simulation/texture.h"

namespace pliant::simulation {

// Wrinkles and knit that are finer than the mesh: slopes over a chart that change how bright it is.
class Relief {
 public:
  // Creases and waves of root mean square slope `steepness` on a chart of this height / width.
  Relief(Random& random, float aspect, float steepness);

  // Slope along u and v at a place, bilinear.
  Eigen::Array2f Slope(float u, float v) const;

 private:
  int columns_ = 0;
  int rows_ = 0;
  std::vector<Eigen::Array2f> slopes_;
};

// A chart's grid after cubic refinement; vertices without cloth are NaN.
struct RefinedChart {
  int columns = 0;  // (chart columns - 1) * factor + 1
  int rows = 0;
  std::vector<Eigen::Vector3f> positions;  // rows x columns
};

RefinedChart Refine(const Chart& chart, const std::vector<Eigen::Vector3f>& particles, int factor);

struct Material {
  const Texture* texture = nullptr;             // null: the tint alone
  Colour tint = Colour::Ones();                 // multiplies the texture
  Colour back = Colour(0.5F, 0.5F, 0.5F, 0.F);  // colour of the other side
  float show_through = 0.0F;                    // how much of the texture the back shows, 0..1
  float gloss = 0.0F;                           // strength of the highlight
  float gloss_exponent = 30.0F;                 // its sharpness
  float weave = 0.0F;                           // contrast of the fabric's threads, 0..0.3
  float threads = 200.0F;                       // threads along u
  const Relief* relief = nullptr;               // fine wrinkles; may be null
  Eigen::Array2f relief_light = Eigen::Array2f::Zero();  // brightness a slope along u, v
};

struct Surface {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;  // outwards
  std::vector<Eigen::Array2f> uv;
  std::vector<float> ambient;  // 0..1, how much of the surroundings a vertex sees
  std::vector<std::array<int, 3>> triangles;
  Material material;
  int chart = -1;                    // index of the object's chart; -1 = not part of the object
  const Outline* outline = nullptr;  // cuts the surface; may be null
  bool closed = false;               // the back is never seen
  bool casts_shadow = true;
};

// The surface of a refined chart. `cell`: physical size of a refined cell, for ambient occlusion.
Surface MakeChartSurface(const RefinedChart& chart, float cell);
Surface MakeSolidSurface(const Solid& solid);

}  // namespace pliant::simulation
