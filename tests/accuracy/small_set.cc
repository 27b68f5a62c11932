// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/small_set.h"

#include "descriptor/base/parallel.h"
#include "descriptor/base/sha256.h"
#include "descriptor/simulation/procedural.h"
#include "descriptor/simulation/scene_file.h"
#include "tests/unit/index_test_images.h"

namespace pliant::testing {
namespace {

constexpr std::uint64_t kSeed = 20;
constexpr std::uint64_t kScenes = 14;
constexpr int kTextures = 32;
constexpr int kTextureSide = 480;

// One scene a texture: a reference and two deformed views.
void MakeScenes(const std::filesystem::path& folder) {
  const simulation::TextureSource textures =
      simulation::ProceduralTextures(kTextures, kSeed, kTextureSide);
  simulation::SceneOptions options;
  options.views = 3;
  options.width = 400;
  options.height = 300;
  options.strength = 0.7F;
  ParallelFor(kScenes, /*threads=*/0, [&](std::size_t i) {
    simulation::WriteSceneFile(folder / simulation::SceneFileName(i),
                               simulation::MakeScene(textures, options, kSeed, i));
  });
}

}  // namespace

std::filesystem::path BaselinePath() {
  return std::filesystem::path(PLIANT_SOURCE_DIR) / "tests/accuracy/baseline.json";
}
std::filesystem::path ModelFolder() {
  return std::filesystem::path(PLIANT_SOURCE_DIR) / "descriptor/model";
}

std::map<std::string, std::string> WeightHashes() {
  std::map<std::string, std::string> hashes;
  for (const std::string name : {"deal", "deal-small"}) {
    hashes[name] = Sha256Hex(ReadBytes(ModelFolder() / (name + ".safetensors")));
  }
  return hashes;
}

evaluation::MatchingReport MeasureSmallSet() {
  const TemporaryFolder folder;
  MakeScenes(folder.path());
  evaluation::MatchingOptions options;
  options.model = ModelFolder();
  options.max_keypoints = 400;
  options.pairs = 24;
  options.seed = kSeed;
  return RunMatchingBenchmark(evaluation::OpenDataset(folder.path()), options);
}

}  // namespace pliant::testing
