// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One view of a scene: the posed body is rendered and photographed. Internal.
#pragma once

#include <optional>
#include <vector>

#include "descriptor/simulation/artwork.h"
#include "descriptor/simulation/cast.h"
#include "descriptor/simulation/scene.h"

namespace pliant::simulation {

// The constant parts of all views of a scene.
struct Stage {
  Cast cast;
  const SceneOptions& options;
  Body body;
  std::vector<Material> materials;  // per chart
};

// A part of chart 0 that the camera aims at.
struct Focus {
  PrintPlace place;
  float width_px = 100.0F;                     // how wide the part would be, seen frontally
  Eigen::Array2f at = Eigen::Array2f::Zero();  // where its middle falls, pixels
};

// The parameters of one view.
struct Shot {
  Pose pose;
  Framing framing;
  float facing_u = 0.5F;
  float strength = 1.0F;    // of light, noise
  bool clear = false;       // no occluders
  bool evenly_lit = false;  // as on a scanner: no shades
  std::optional<Focus> focus;
  std::optional<DevelopOptions> develop;  // none: the photograph as it is taken
};

// How a surface looks; `texture` may be null.
Material DrawMaterial(const Texture* texture, Random& random);

View TakeView(const Stage& stage, Shot shot, Random random);

}  // namespace pliant::simulation
