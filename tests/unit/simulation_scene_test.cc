// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Scenes of the simulator: seeds, presets, sequences, options.
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "tests/unit/small_scenes.h"

namespace pliant::simulation {
namespace {

TEST(SimulationScene, SameSeedSameBytesOtherSeedOtherImage) {
  const SceneOptions options = SmallOptions(Preset::kPairs);
  const Scene first = MakeScene(Textures(), options, 21, 4);
  (void)MakeScene(Textures(), options, 21, 5);
  const Scene again = MakeScene(Textures(), options, 21, 4);
  const Scene other = MakeScene(Textures(), options, 22, 4);
  for (std::size_t v = 0; v < first.views.size(); ++v) {
    EXPECT_EQ(first.views[v].image.pixels, again.views[v].image.pixels);
    EXPECT_EQ(first.views[v].uv, again.views[v].uv);
    EXPECT_NE(first.views[v].image.pixels, other.views[v].image.pixels);
  }
}

TEST(SimulationScene, SuccessiveScenesShowAllTextures) {
  SceneOptions options = SmallOptions(Preset::kPlanar);
  options.views = 2;
  options.width = options.height = 64;
  std::set<std::string> seen;
  for (std::uint64_t i = 0; i < 8; ++i)
    seen.insert(MakeScene(Textures(), options, 9, i).textures[0]);
  EXPECT_EQ(seen.size(), 8U);
}

TEST(SimulationScene, ReferencesOfObjectsStandAlone) {
  int before_images = 0;
  for (std::uint64_t index = 0; index < 6; ++index) {
    SCOPED_TRACE("seed 3 object " + std::to_string(index));
    const Scene scene = MakeScene(Textures(), SmallOptions(Preset::kObjects), 3, index);
    EXPECT_EQ(scene.views.front().backdrop, "");
    for (std::size_t v = 1; v < scene.views.size(); ++v) {
      before_images += scene.views[v].backdrop.empty() ? 0 : 1;
    }
  }
  EXPECT_GT(before_images, 0);
}

TEST(SimulationScene, SweepsChangeWhatTheySay) {
  SceneOptions options = SmallOptions(Preset::kRotation);
  options.views = 4;
  const Scene rotation = MakeScene(Textures(), options, 1, 0);
  EXPECT_FLOAT_EQ(rotation.views[1].framing.roll_deg, 0.0F);
  EXPECT_FLOAT_EQ(rotation.views[2].framing.roll_deg, 90.0F);
  EXPECT_FLOAT_EQ(rotation.views[3].framing.roll_deg, 180.0F);
  options.preset = Preset::kScale;
  const Scene scale = MakeScene(Textures(), options, 1, 0);
  EXPECT_FLOAT_EQ(scale.views[1].framing.scale, 1.0F);
  EXPECT_FLOAT_EQ(scale.views[3].framing.scale, 0.25F);
  const auto seen = [](const View& view) {
    return static_cast<double>(
        std::ranges::count_if(view.chart, [](auto c) { return c != kNoChart; }));
  };
  EXPECT_NEAR(seen(scale.views[3]) / seen(scale.views[2]), 0.25 * 0.63, 0.1);
}

// A body whose motion starts folded unfolds backwards to the flat sheet, one step after another.
TEST(SimulationMotion, SequencesOfFoldsStartFlatAndMoveSteadily) {
  const Body body = MakeSheet(1.2F, 18);
  int folded = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Random random(seed, 0);
    const Motion motion = DrawMotion(body, random, 1.0F);
    if (motion.wraps.empty()) continue;
    ++folded;
    const std::vector<Pose> poses = PerformSequence(body, motion, 9, 2);
    ASSERT_EQ(poses.size(), 9U);
    const auto moved = [&](std::size_t from, std::size_t to) {
      float sum = 0.0F;
      for (std::size_t i = 0; i < body.rest.size(); ++i)
        sum += (poses[from].positions[i] - poses[to].positions[i]).norm();
      return sum / static_cast<float>(body.rest.size());
    };
    for (std::size_t i = 0; i < body.rest.size(); ++i)
      EXPECT_EQ(poses[0].positions[i], body.rest[i]) << motion.name;
    EXPECT_GT(moved(0, 6), 1.3F * moved(0, 2)) << motion.name << " seed " << seed;
    for (const Pose& pose : poses) EXPECT_LT(pose.stretch_p95, 0.1F) << motion.name;
  }
  EXPECT_GT(folded, 5);
}

TEST(SimulationScene, SequencesTurnAndShrinkAsAsked) {
  SceneOptions options = SmallOptions(Preset::kSequence);
  options.turn_deg = 180.0F;
  options.least_scale = 0.3F;
  for (std::uint64_t index = 0; index < 4; ++index) {
    const Scene scene = MakeScene(Textures(), options, 7, index);
    const float turned =
        std::abs(scene.views.back().framing.roll_deg - scene.views[1].framing.roll_deg);
    EXPECT_GE(turned, 0.3F * 180.0F - 1e-3F);
    EXPECT_LE(turned, 180.0F + 1e-3F);
    EXPECT_GE(scene.views.back().framing.scale, 0.3F);
    EXPECT_LE(scene.views.back().framing.scale, 1.0F);
  }
}

TEST(SimulationScene, EveryOptionOutOfRangeIsNamed) {
  using Change = void (*)(SceneOptions&);
  const std::vector<std::pair<std::string, Change>> cases = {
      {"views", [](SceneOptions& o) { o.views = 1; }},
      {"views", [](SceneOptions& o) { o.views = -3; }},
      {"width", [](SceneOptions& o) { o.width = -640; }},
      {"height", [](SceneOptions& o) { o.height = 0; }},
      {"height", [](SceneOptions& o) { o.height = 1 << 20; }},
      {"channels", [](SceneOptions& o) { o.channels = 2; }},
      {"strength", [](SceneOptions& o) { o.strength = std::numeric_limits<float>::quiet_NaN(); }},
      {"strength", [](SceneOptions& o) { o.strength = 0.0F; }},
      {"occluders", [](SceneOptions& o) { o.occluders = 1.5F; }},
      {"occluders", [](SceneOptions& o) { o.occluders = std::numeric_limits<float>::quiet_NaN(); }},
      {"cells", [](SceneOptions& o) { o.cells = 2; }},
      {"refine", [](SceneOptions& o) { o.refine = 0; }},
      {"turn_deg", [](SceneOptions& o) { o.turn_deg = -1.0F; }},
      {"least_scale", [](SceneOptions& o) { o.least_scale = 0.0F; }},
  };
  for (const auto& [field, change] : cases) {
    SceneOptions options;
    change(options);
    try {
      Validate(options);
      ADD_FAILURE() << field << " was accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
      EXPECT_THAT(error.what(), testing::HasSubstr(field));
    }
  }
  EXPECT_THROW(MakeScene(TextureSource(), SceneOptions(), 1, 0), Error);
  EXPECT_THROW(ParsePreset("retrieval"), Error);
  EXPECT_EQ(ParsePreset("rotation"), Preset::kRotation);
}

}  // namespace
}  // namespace pliant::simulation
