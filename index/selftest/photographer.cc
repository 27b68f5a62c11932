// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/selftest/photographer.h"

#include "descriptor/simulation/procedural.h"
#include "descriptor/simulation/scene.h"

namespace pliant {
namespace {

constexpr int kSurroundings = 40;
constexpr int kSurroundingsSide = 512;  // pixels
constexpr int kOthers = 7;              // surroundings of one photo
// Of the object, in widths of the photo. Prints on shirts in street photos have 0.2 to 0.5, notes
// and packages that are held into a camera 0.4 to 1.
constexpr float kLeastWidth = 0.15F;
constexpr float kMostWidth = 0.75F;

}  // namespace

Photographer::Photographer() {
  for (std::uint64_t i = 0; i < kSurroundings; ++i) {
    const auto kind = static_cast<simulation::ProceduralKind>(i % simulation::kProceduralKinds);
    surroundings_.push_back(simulation::PaintProcedural(kind, i, kSurroundingsSide));
  }
}

SimulatedPhoto Photographer::Take(const Image& picture, double strength,
                                  std::uint64_t number) const {
  simulation::TextureSource textures;
  textures.Add("picture", picture);
  for (std::uint64_t i = 0; i < kOthers; ++i) {
    const std::uint64_t other = (number * kOthers + i * 5) % kSurroundings;
    textures.Add("surroundings", surroundings_[other]);
  }
  simulation::SceneOptions options;
  options.preset = simulation::Preset::kStreet;
  options.views = 2;
  options.width = 800;
  options.height = 600;
  options.channels = 3;
  options.printed = 0;
  options.least_width = kLeastWidth;
  options.most_width = kMostWidth;
  options.strength = static_cast<float>(strength);
  // A multiple of the number of textures: the scene shows the first one.
  const simulation::Scene scene =
      simulation::MakeScene(textures, options, number * textures.size(), 0);
  const simulation::View& view = scene.views.back();
  return {view.image, simulation::Coverage(view.chart)};
}

}  // namespace pliant
