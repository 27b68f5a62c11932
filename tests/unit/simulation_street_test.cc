// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The preset street and its parts: drawings, prints, relief, what becomes of a photograph.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "descriptor/simulation/artwork.h"
#include "descriptor/simulation/photo.h"
#include "descriptor/simulation/surface.h"
#include "tests/unit/small_scenes.h"

namespace pliant::simulation {
namespace {

using Eigen::Array2f;
using Eigen::Array4f;

// A bright disc on a dark ground, in linear light.
Frame Disc(int width, int height, const Array2f& centre, float radius) {
  Frame frame;
  frame.width = width;
  frame.height = height;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Array2f offset = Array2f(static_cast<float>(x), static_cast<float>(y)) - centre;
      const float inside = std::clamp(radius - offset.matrix().norm() + 0.5F, 0.0F, 1.0F);
      frame.colour.emplace_back(Colour::Constant(0.05F + 0.4F * inside));
    }
  }
  return frame;
}

Array2f CentreOfLight(const Image& image) {
  const float ground = image.pixels.front();
  Array2f sum = Array2f::Zero();
  float weight = 0.0F;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const float light = std::max(
          0.0F,
          static_cast<float>(
              image.pixels[static_cast<std::size_t>((y * image.width + x) * image.channels)]) -
              ground - 20.0F);
      sum += light * Array2f(static_cast<float>(x), static_cast<float>(y));
      weight += light;
    }
  }
  return sum / weight;
}

TEST(SimulationDevelop, NothingMovesHoweverManyPixelsWereLost) {
  const Array2f centre(41.0F, 27.0F);
  for (const float enlarge : {1.0F, 1.37F, 2.0F, 2.9F}) {
    for (const bool cubic : {false, true}) {
      SCOPED_TRACE(enlarge);
      Frame frame = Disc(96, 64, centre, 14.0F);
      DevelopOptions options;
      options.enlarge = enlarge;
      options.cubic = cubic;
      options.smear = 0.5F;
      options.contrast = 0.4F;
      options.sharpen = 0.8F;
      options.jpeg_quality = 90;
      options.jpeg_shift = 3;
      Random random(3);
      PhotoOptions photo;
      const Image image = Develop(frame, photo, options, 1, random);
      ASSERT_EQ(image.width, 96);
      ASSERT_EQ(image.height, 64);
      EXPECT_LT((CentreOfLight(image) - centre).matrix().norm(), 0.15F);
    }
  }
}

TEST(SimulationDevelop, EnlargingKeepsFlatAndSlantedImages) {
  Image ramp{12, 9, 3, {}};
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 12; ++x) {
      ramp.pixels.push_back(77);
      ramp.pixels.push_back(static_cast<std::uint8_t>(20 + 15 * x));
      ramp.pixels.push_back(static_cast<std::uint8_t>(10 + 20 * y));
    }
  }
  for (const bool cubic : {false, true}) {
    const Image large = Enlarge(ramp, 36, 18, cubic);
    for (int y = 4; y < 14; ++y) {  // away from the borders, which repeat
      for (int x = 6; x < 30; ++x) {
        const auto at = static_cast<std::size_t>(3 * (y * 36 + x));
        EXPECT_EQ(large.pixels[at], 77);
        EXPECT_NEAR(large.pixels[at + 1], 20.0 + 15.0 * ((x + 0.5) / 3.0 - 0.5), 1.0);
        EXPECT_NEAR(large.pixels[at + 2], 10.0 + 20.0 * ((y + 0.5) / 2.0 - 0.5), 1.0);
      }
    }
  }
}

TEST(SimulationDevelop, ShrinkingKeepsTheLight) {
  const Frame frame = Disc(50, 41, {20.0F, 22.0F}, 9.0F);
  const auto mean = [](const Frame& of) {
    double sum = 0.0;
    for (const Colour& colour : of.colour) sum += static_cast<double>(colour[0]);
    return sum / static_cast<double>(of.colour.size());
  };
  EXPECT_NEAR(mean(Shrink(frame, 23, 17)), mean(frame), 1e-4);
}

TEST(SimulationDevelop, SharpeningLeavesFlatPlacesAlone) {
  Image image{40, 8, 1, std::vector<std::uint8_t>(320, 60)};
  for (int y = 0; y < 8; ++y) {
    for (int x = 20; x < 40; ++x) image.pixels[static_cast<std::size_t>(40 * y + x)] = 180;
  }
  Sharpen(image, 1.0F, 1.0F);
  EXPECT_EQ(image.pixels[40 * 4 + 5], 60);
  EXPECT_EQ(image.pixels[40 * 4 + 35], 180);
  EXPECT_LT(image.pixels[40 * 4 + 19], 50);
  EXPECT_GT(image.pixels[40 * 4 + 20], 190);
}

TEST(SimulationRelief, HasTheSteepnessThatIsAskedFor) {
  Random random(5);
  const Relief relief(random, 1.3F, 0.2F);
  double square = 0.0;
  constexpr int kSteps = 200;
  for (int y = 0; y < kSteps; ++y) {
    for (int x = 0; x < kSteps; ++x) {
      const Array2f slope =
          relief.Slope(static_cast<float>(x) / (kSteps - 1), static_cast<float>(y) / (kSteps - 1));
      ASSERT_TRUE(slope.allFinite());
      square += static_cast<double>(slope.square().sum());
    }
  }
  EXPECT_NEAR(std::sqrt(square / (kSteps * kSteps)), 0.2, 0.04);
}

TEST(SimulationArtwork, InksStayWithinTheirCoverAndLeaveGroundBare) {
  const auto image = Textures().Get(1);
  for (std::uint64_t seed = 0; seed < 16; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const Artwork artwork = DrawArtwork(random, seed % 2 == 0 ? image.get() : nullptr);
    ASSERT_EQ(artwork.inks.size(),
              static_cast<std::size_t>(artwork.width) * static_cast<std::size_t>(artwork.height));
    for (const Array4f& ink : artwork.inks) {
      ASSERT_TRUE((ink >= 0.0F).all() && (ink <= 1.001F).all());
      ASSERT_TRUE((ink.head<3>() <= ink[3] + 0.02F).all()) << ink.transpose();
    }
    EXPECT_GT(Contrast(artwork, artwork.ground), 0.05F);
  }
}

TEST(SimulationArtwork, ClothIsBareAroundThePrint) {
  Random random(8);
  const Artwork artwork = DrawArtwork(random, nullptr);
  PrintOptions options;
  options.cloth = Ink(0.2F, 0.4F, 0.6F);
  const Image cloth = PrintOn(artwork, {{0.4F, 0.4F}, {0.6F, 0.6F}}, options, 100, 100, random);
  int printed = 0;
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 100; ++x) {
      const std::uint8_t* pixel = cloth.pixels.data() + 3 * (100 * y + x);
      const bool bare = pixel[0] == 51 && pixel[1] == 102 && pixel[2] == 153;
      if (x < 39 || y < 39 || x > 60 || y > 60) {
        ASSERT_TRUE(bare) << x << ' ' << y;
      }
      printed += bare ? 0 : 1;
    }
  }
  EXPECT_GT(printed, 10);
}

TEST(SimulationStreet, ScenesDependOnSeedAndNumberOnly) {
  const SceneOptions options = SmallOptions(Preset::kStreet);
  const Scene first = MakeScene(Textures(), options, 21, 4);
  (void)MakeScene(Textures(), options, 21, 5);
  const Scene again = MakeScene(Textures(), options, 21, 4);
  ASSERT_EQ(first.views.size(), 3U);
  for (std::size_t v = 0; v < first.views.size(); ++v) {
    EXPECT_EQ(first.views[v].image.pixels, again.views[v].image.pixels);
    EXPECT_EQ(first.views[v].uv, again.views[v].uv);
  }
}

TEST(SimulationStreet, ObjectsAreSmallInPhotographsAndLargeInTheCatalogue) {
  SceneOptions options = SmallOptions(Preset::kStreet);
  options.width = 240;
  options.height = 180;
  float sum = 0.0F;  // of the photographs' scales over the catalogue's
  float photographs = 0.0F;
  for (std::uint64_t index = 0; index < 4; ++index) {
    const Scene scene = MakeScene(Textures(), options, 2, index);
    // Pixels a length of the chart, from the steps between the vertices that are known.
    const auto scale = [&](const View& view) {
      std::vector<float> steps;
      for (int row = 0; row < scene.grid_rows; ++row) {
        for (int column = 0; column + 1 < scene.grid_columns; ++column) {
          const auto at = static_cast<std::size_t>(row * scene.grid_columns + column);
          const float step = (view.grid[at + 1] - view.grid[at]).matrix().norm();
          if (std::isfinite(step)) steps.push_back(step);
        }
      }
      std::ranges::sort(steps);
      return steps[steps.size() * 9 / 10];
    };
    for (std::size_t v = 1; v < scene.views.size(); ++v) {
      photographs += 1.0F;
      ASSERT_TRUE(scene.views[v].develop.has_value());
      const float taken = scale(scene.views[v]) / scene.views[v].develop->enlarge;
      sum += taken / scale(scene.views[0]);
    }
  }
  EXPECT_LT(sum / photographs, 0.85F);
}

}  // namespace
}  // namespace pliant::simulation
