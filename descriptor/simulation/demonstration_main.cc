// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant-simulate-demonstration DIR: paints the objects of server/web/demo, each flat (NAME.jpg),
// to be indexed, and crumpled (NAME-crumpled.jpg), to search with.
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "descriptor/image/image.h"
#include "descriptor/simulation/procedural.h"
#include "descriptor/simulation/scene.h"

namespace {
using namespace pliant::simulation;

void Write(const std::filesystem::path& path, const pliant::Image& image) {
  const auto jpeg = pliant::EncodeJpeg(image, /*quality=*/85);
  std::ofstream file;
  file.exceptions(std::ios::failbit | std::ios::badbit);
  file.open(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(jpeg.data()), std::ssize(jpeg));
}

// Scene seeds are chosen by eye: the sheet is clearly crumpled and mostly in the image.
void Paint(const std::string& path, ProceduralKind kind, std::uint64_t scene_seed) {
  constexpr std::uint64_t kSurroundings = 5;
  const pliant::Image flat = PaintProcedural(kind, 11, 640);
  Write(path + ".jpg", flat);
  TextureSource textures;
  textures.Add("object", flat);
  for (std::uint64_t i = 0; i < kSurroundings; ++i) {
    const auto around = i % 2 == 0 ? ProceduralKind::kWoven : ProceduralKind::kChecks;
    textures.Add("surroundings", PaintProcedural(around, 9000 + i, 320));
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
  const Scene scene = MakeScene(textures, options, scene_seed * (kSurroundings + 1), 0);
  Write(path + "-crumpled.jpg", scene.views.back().image);
}
}  // namespace

int main(int count, char** arguments) {
  if (count != 2) return 2;
  const std::string folder = std::string(arguments[1]) + "/";
  Paint(folder + "town-map", ProceduralKind::kMap, 1);
  Paint(folder + "tea-packet", ProceduralKind::kPackaging, 1);
  Paint(folder + "newspaper", ProceduralKind::kNewspaper, 11);
  Paint(folder + "flower-cloth", ProceduralKind::kFloral, 1);
  Paint(folder + "poster", ProceduralKind::kLettering, 4);
  Paint(folder + "team-flag", ProceduralKind::kLogo, 1);
}
