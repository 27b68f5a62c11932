// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/demonstration.h"

#include <array>
#include <cstdint>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/simulation/procedural.h"
#include "descriptor/simulation/scene.h"

namespace pliant::simulation {

namespace {

constexpr int kSidePx = 640;
// What lies behind and around: other pictures than the objects'.
constexpr std::size_t kSurroundings = 5;
constexpr std::uint64_t kSurroundingsSeed = 9000;

// Seeds chosen by eye: a sheet that is clearly crumpled and mostly in the picture.
struct Recipe {
  const char* name;
  const char* material;
  ProceduralKind kind;
  std::uint64_t picture_seed;
  std::uint64_t scene_seed;  // times kSurroundings + 1
};
constexpr std::array<Recipe, 6> kRecipes{{
    {"town map", "paper", ProceduralKind::kMap, 11, 1},
    {"tea packet", "paper", ProceduralKind::kPackaging, 11, 1},
    {"newspaper", "paper", ProceduralKind::kNewspaper, 11, 11},
    {"flower cloth", "cloth", ProceduralKind::kFloral, 11, 1},
    {"poster", "paper", ProceduralKind::kLettering, 11, 4},
    {"team flag", "cloth", ProceduralKind::kLogo, 11, 1},
}};

const Recipe& RecipeOf(std::size_t number) {
  if (number < kRecipes.size()) return kRecipes[number];
  throw Error(ErrorCode::kInvalidArgument, "option_out_of_range",
              "there is no demonstration object " + std::to_string(number));
}

}  // namespace

const std::vector<std::string>& DemonstrationObjects() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const Recipe& recipe : kRecipes) list.emplace_back(recipe.name);
    return list;
  }();
  return names;
}

std::string DemonstrationMaterial(std::size_t number) { return RecipeOf(number).material; }

Image PaintDemonstrationObject(std::size_t number) {
  const Recipe& recipe = RecipeOf(number);
  return PaintProcedural(recipe.kind, recipe.picture_seed, kSidePx);
}

Image CrumpleDemonstrationObject(std::size_t number) {
  const Recipe& recipe = RecipeOf(number);
  TextureSource textures;
  textures.Add(recipe.name, PaintDemonstrationObject(number));
  for (std::size_t i = 0; i < kSurroundings; ++i) {
    const auto kind = i % 2 == 0 ? ProceduralKind::kWoven : ProceduralKind::kChecks;
    textures.Add("surroundings", PaintProcedural(kind, kSurroundingsSeed + i, kSidePx / 2));
  }
  SceneOptions options;
  options.preset = Preset::kObjects;
  options.views = 2;
  options.width = 800;
  options.height = 600;
  options.channels = 3;
  options.strength = 0.7F;
  options.occluders = 0.0F;
  // A multiple of the number of textures: the scene shows the first one.
  const std::uint64_t seed = recipe.scene_seed * (kSurroundings + 1);
  Scene scene = MakeScene(textures, options, seed, 0);
  return std::move(scene.views.back().image);
}

}  // namespace pliant::simulation
