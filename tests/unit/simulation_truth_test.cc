// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The truth of simulated scenes against geometry: coordinates, visibility, outlines, occluders.
#include <algorithm>
#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "descriptor/simulation/surface.h"
#include "descriptor/simulation/view.h"
#include "tests/unit/small_scenes.h"

namespace pliant::simulation {
namespace {

using Eigen::Array2f;
using Eigen::Vector3f;

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

TEST(SimulationTruth, UvOfAPixelLeadsBackToThePixel) {
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

TEST(SimulationTruth, PlanarViewsAreTheCamerasHomographies) {
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

TEST(SimulationTruth, VisiblePointsCarryOverBetweenViews) {
  // A flat sheet hides nothing of itself: each of its points that falls into another image is
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

TEST(SimulationTruth, NearerSurfacesAndBacksHideTheTruth) {
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
  EXPECT_EQ(Coverage(behind.chart), 0.0);
  EXPECT_GT(behind.colour[behind.At(50, 50)].maxCoeff(), 0.0F);
}

TEST(SimulationTruth, ShirtsEndAtTheirOutline) {
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

TEST(SimulationTruth, OccludersTakeTheTruthAway) {
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
    EXPECT_LT(Coverage(frame.chart), 1.0);
  }
}

}  // namespace
}  // namespace pliant::simulation
