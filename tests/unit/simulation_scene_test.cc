// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Scenes of the simulator: truth against geometry, visibility, outlines, occluders, options.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/error.h"
#include "descriptor/simulation/backdrop.h"
#include "descriptor/simulation/procedural.h"
#include "descriptor/simulation/scene.h"
#include "descriptor/simulation/surface.h"

namespace pliant::simulation {
namespace {

using Eigen::Array2f;
using Eigen::Vector3f;

const TextureSource& Textures() {
  static const TextureSource textures = ProceduralTextures(8, 5, 128);
  return textures;
}

SceneOptions SmallOptions(Preset preset) {
  SceneOptions options;
  options.preset = preset;
  options.views = 3;
  options.width = 200;
  options.height = 150;
  options.cells = 18;
  return options;
}

Array2f Uv(const View& view, std::size_t at) {
  return Array2f(view.uv[2 * at], view.uv[2 * at + 1]) / 65535.0F;
}

// Where the chart's point falls in the view, by bilinear interpolation of the grid.
Array2f Lookup(const Scene& scene, const View& view, int chart, const Array2f& uv) {
  const float x = uv.x() * static_cast<float>(scene.grid_columns - 1);
  const float y = uv.y() * static_cast<float>(scene.grid_rows - 1);
  const int x0 = std::min(static_cast<int>(x), scene.grid_columns - 2);
  const int y0 = std::min(static_cast<int>(y), scene.grid_rows - 2);
  const auto at = [&](int dx, int dy) {
    return view.grid[static_cast<std::size_t>(
        (chart * scene.grid_rows + y0 + dy) * scene.grid_columns + x0 + dx)];
  };
  const float fx = x - static_cast<float>(x0);
  const float fy = y - static_cast<float>(y0);
  return (1.0F - fy) * ((1.0F - fx) * at(0, 0) + fx * at(1, 0)) +
         fy * ((1.0F - fx) * at(0, 1) + fx * at(1, 1));
}

TEST(SimulationScene, UvOfAPixelLeadsBackToThePixel) {
  for (std::uint64_t index = 0; index < 8; ++index) {
    SCOPED_TRACE("seed 11 scene " + std::to_string(index));
    const Scene scene = MakeScene(Textures(), SmallOptions(Preset::kPairs), 11, index);
    for (const View& view : scene.views) {
      std::vector<float> errors;
      for (int y = 0; y < 150; ++y) {
        for (int x = 0; x < 200; ++x) {
          const auto at = static_cast<std::size_t>(y * 200 + x);
          if (view.chart[at] == kNoChart) continue;
          const Array2f back = Lookup(scene, view, view.chart[at], Uv(view, at));
          errors.push_back(
              std::hypot(back.x() - static_cast<float>(x), back.y() - static_cast<float>(y)));
        }
      }
      ASSERT_GT(errors.size(), 300U);
      // A pixel centre just outside a folding edge is moved onto the cloth; the rest is exact.
      EXPECT_FALSE(std::ranges::any_of(errors, [](float e) { return std::isnan(e); }) &&
                   scene.kind != BodyKind::kShirt);
      std::erase_if(errors, [](float e) { return std::isnan(e); });
      std::ranges::sort(errors);
      EXPECT_LT(errors[errors.size() * 98 / 100], 0.15F);
    }
  }
}

TEST(SimulationScene, PlanarViewsAreTheCamerasHomographies) {
  const Scene scene = MakeScene(Textures(), SmallOptions(Preset::kPlanar), 3, 1);
  ASSERT_EQ(scene.kind, BodyKind::kSheet);
  const Array2f size = scene.chart_sizes[0];
  for (const View& view : scene.views) {
    std::size_t seen = 0;
    for (std::size_t at = 0; at < view.chart.size(); ++at) {
      if (view.chart[at] == kNoChart) continue;
      const Array2f flat = (Uv(view, at) - 0.5F) * size;
      const Array2f back =
          view.camera.Project(view.camera.ToCamera(Vector3f(flat.x(), flat.y(), 0.0F)));
      ASSERT_NEAR(back.x(), static_cast<float>(at % 200), 0.05F);
      ASSERT_NEAR(back.y(), static_cast<float>(at / 200), 0.05F);
      ++seen;
    }
    EXPECT_GT(seen, 300U);
  }
}

TEST(SimulationScene, VisiblePointsCarryOverBetweenViews) {
  // A flat sheet hides nothing of itself: each of its points that falls into another picture is
  // seen there, with the same coordinates, at the pixel where the grid says.
  SceneOptions options = SmallOptions(Preset::kPlanar);
  options.views = 4;
  options.occluders = 0.0F;
  const Scene scene = MakeScene(Textures(), options, 12, 2);
  const View& a = scene.views[0];
  for (std::size_t v = 1; v < scene.views.size(); ++v) {
    const View& b = scene.views[v];
    std::size_t carried = 0;
    std::size_t same = 0;
    for (std::size_t at = 0; at < a.chart.size(); ++at) {
      if (a.chart[at] == kNoChart) continue;
      const Array2f there = Lookup(scene, b, a.chart[at], Uv(a, at));
      const int x = static_cast<int>(std::lround(there.x()));
      const int y = static_cast<int>(std::lround(there.y()));
      if (x < 0 || y < 0 || x >= 200 || y >= 150) continue;
      ++carried;
      const auto other = static_cast<std::size_t>(y * 200 + x);
      if (b.chart[other] != a.chart[at]) continue;  // the border of the sheet
      const Array2f back = Lookup(scene, b, b.chart[other], Uv(b, other));
      same += (back - there).abs().maxCoeff() < 0.65F ? 1 : 0;
    }
    ASSERT_GT(carried, 200U);
    EXPECT_GT(static_cast<double>(same) / static_cast<double>(carried), 0.95);
  }
}

Surface Square(float z, float half, int chart) {
  Body body = MakeSheet(1.0F, 8);
  std::vector<Vector3f> positions;
  for (const Vector3f& rest : body.rest)
    positions.emplace_back(2.0F * half * rest.x(), 2.0F * half * rest.y(), z);
  Surface surface = MakeChartSurface(Refine(body.charts[0], positions, 2), 0.06F);
  surface.chart = chart;
  return surface;
}

TEST(SimulationScene, NearerSurfacesAndBacksHideTheTruth) {
  Camera camera;
  camera.width = 101;
  camera.height = 101;
  camera.centre_x = camera.centre_y = 50.0F;
  camera.focal_px = 100.0F;
  const Lighting lighting;
  const Frame both = Render({Square(0.0F, 0.5F, 0), Square(-0.5F, 0.1F, 1)}, lighting, camera, {});
  EXPECT_EQ(both.chart[both.At(50, 50)], 1);
  EXPECT_EQ(both.chart[both.At(70, 50)], 0);
  EXPECT_EQ(both.chart[both.At(2, 2)], kNoChart);
  // In the middle of a square is the middle of its chart.
  EXPECT_NEAR(both.uv[2 * both.At(50, 50)], 32768, 200);
  // Order of drawing does not matter.
  const Frame swapped =
      Render({Square(-0.5F, 0.1F, 1), Square(0.0F, 0.5F, 0)}, lighting, camera, {});
  EXPECT_EQ(both.chart, swapped.chart);
  EXPECT_EQ(both.uv, swapped.uv);
  // Seen from behind there is cloth but no truth.
  camera.rotation = Eigen::AngleAxisf(3.14159265F, Vector3f::UnitY()).toRotationMatrix();
  const Frame behind = Render({Square(0.0F, 0.5F, 0)}, lighting, camera, {});
  EXPECT_EQ(behind.Coverage(), 0.0);
  EXPECT_GT(behind.colour[behind.At(50, 50)].maxCoeff(), 0.0F);
}

TEST(SimulationScene, ShirtsEndAtTheirOutline) {
  Random random(4);
  const Body shirt = MakeShirt(1.0F, 20, random);
  const Chart& chart = shirt.charts[0];
  Surface surface = MakeChartSurface(Refine(chart, shirt.rest, 2), 0.03F);
  surface.chart = 0;
  surface.outline = &chart.outline;
  Camera camera;
  camera.width = 160;
  camera.height = 160;
  camera.centre_x = camera.centre_y = 79.5F;
  camera.focal_px = 280.0F;
  const Frame frame = Render({surface}, Lighting(), camera, {});
  std::size_t inside = 0;
  std::size_t strayed = 0;
  for (std::size_t at = 0; at < frame.chart.size(); ++at) {
    if (frame.chart[at] == kNoChart) continue;
    ++inside;
    const Array2f uv = Array2f(frame.uv[2 * at], frame.uv[2 * at + 1]) / 65535.0F;
    strayed += chart.outline.Contains(uv.x(), uv.y()) ? 0 : 1;
  }
  const double area =
      std::accumulate(chart.outline.inside.begin(), chart.outline.inside.end(), 0.0) /
      (512.0 * 512.0);
  EXPECT_NEAR(static_cast<double>(inside) / (140.0 * 140.0), area, 0.03);
  EXPECT_LT(strayed, inside / 50);
  EXPECT_LT(area, 0.8);
  EXPECT_GT(std::ranges::count(chart.particle, -1), 10);
}

TEST(SimulationScene, OccludersTakeTheTruthAway) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    SCOPED_TRACE(seed);
    Frame frame;
    frame.width = 120;
    frame.height = 90;
    frame.colour.assign(120 * 90, Colour(0.1F, 0.9F, 0.1F, 0.0F));
    frame.chart.assign(120 * 90, 0);
    frame.uv.assign(2 * 120 * 90, 7);
    Random random(seed);
    DrawOccluders(random, nullptr, frame);
    std::size_t hidden = 0;
    for (std::size_t i = 0; i < frame.chart.size(); ++i) {
      if (frame.chart[i] == kNoChart) {
        ++hidden;
        EXPECT_EQ(frame.uv[2 * i], 0);
      } else {
        // Where the truth stands the cloth is seen, at most in shadow.
        EXPECT_NEAR(frame.colour[i][1] / frame.colour[i][0], 9.0F, 1.5F);
        EXPECT_EQ(frame.uv[2 * i], 7);
      }
    }
    EXPECT_GT(hidden, 5U);
    EXPECT_LT(frame.Coverage(), 1.0);
  }
}

TEST(SimulationScene, SameSeedSameBytesOtherSeedOtherPicture) {
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
  int before_pictures = 0;
  for (std::uint64_t index = 0; index < 6; ++index) {
    SCOPED_TRACE("seed 3 object " + std::to_string(index));
    const Scene scene = MakeScene(Textures(), SmallOptions(Preset::kObjects), 3, index);
    EXPECT_EQ(scene.views.front().backdrop, "");
    for (std::size_t v = 1; v < scene.views.size(); ++v) {
      before_pictures += scene.views[v].backdrop.empty() ? 0 : 1;
    }
  }
  EXPECT_GT(before_pictures, 0);
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
