// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Scenes that are small enough for tests.
#pragma once

#include "descriptor/simulation/procedural.h"
#include "descriptor/simulation/scene.h"

namespace pliant::simulation {

inline const TextureSource& Textures() {
  static const TextureSource textures = ProceduralTextures(8, 5, 128);
  return textures;
}

inline SceneOptions SmallOptions(Preset preset) {
  SceneOptions options;
  options.preset = preset;
  options.views = 3;
  options.width = 200;
  options.height = 150;
  options.cells = 18;
  return options;
}

}  // namespace pliant::simulation
