// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One view of a scene: the posed body is rendered and photographed. Internal.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "descriptor/simulation/artwork.h"
#include "descriptor/simulation/random.h"
#include "descriptor/simulation/renderer.h"
#include "descriptor/simulation/scene.h"
#include "descriptor/simulation/texture.h"

namespace pliant::simulation {

// The object's image first, then some others for backgrounds, backs and solids.
using Cast = std::vector<std::shared_ptr<const Texture>>;

// The textures of scene `index`. For the preset objects, the others come from the half of the
// textures that scenes take last. As long as a set has no more objects than the other half, no
// image shows another object of the set in its background, where two answers would be correct.
Cast DrawCast(const TextureSource& textures, Preset preset, std::uint64_t seed, std::uint64_t index,
              Random& random);

// One of the others; null where there is none.
const Texture* AnyOther(const Cast& cast, Random& random);

// Draws up to three opaque occluders (a strip, a disc, a finger-like capsule) over the frame and
// removes the ground truth of hidden pixels. `texture` (may be null) colours some of them.
void DrawOccluders(Random& random, const Texture* texture, Frame& frame);

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

// In-plane rotation 0..360 degrees, scale 0.3..2, tilt to 60 degrees.
Framing DrawFraming(Random& random, float strength);
// Nearly upright, frontal and filling the image.
Framing DrawFrontalFraming(Random& random);

View TakeView(const Stage& stage, Shot shot, Random random);

// Fills a scene: view 0 is the artwork (or the object) as in a catalogue, the others are
// photographs in which it is 55 to 220 pixels wide, printed on a shirt or another cloth (bare
// ground, cloth of another colour, fine wrinkles) or all of a note, poster, can or bag; some are
// then enlarged.
void FillStreet(Stage& stage, Random& random, Scene& scene);

}  // namespace pliant::simulation
