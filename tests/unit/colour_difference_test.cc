// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/colour_difference.h"

#include <functional>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "index/verify/warp_geometry.h"

namespace pliant {
namespace {

constexpr int kSide = 320;  // of the reference; 5 pixels a cell

// The chroma at a place of the reference, from 0 to 1 in both directions.
using Paint = std::function<Vec2(double x, double y)>;

Features Painted(const Paint& paint, int width = kSide, int height = kSide) {
  Features features;
  features.width = width;
  features.height = height;
  features.colours.width = width / 5;
  features.colours.height = height / 5;
  for (int y = 0; y < height / 5; ++y) {
    for (int x = 0; x < width / 5; ++x) {
      const Vec2 chroma = paint((x + 0.5) * 5 / kSide, (y + 0.5) * 5 / kSide);
      features.colours.chroma.push_back(static_cast<std::uint8_t>(chroma.x));
      features.colours.chroma.push_back(static_cast<std::uint8_t>(chroma.y));
    }
  }
  return features;
}

Vec2 RedAndBlue(double x, double /*y*/) { return x < 0.5 ? Vec2{188, 128} : Vec2{128, 68}; }
Vec2 BlueAndRed(double x, double y) { return RedAndBlue(1 - x, y); }

// Enlarges `scale` times, then moves.
ThinPlateSpline Warp(double scale, Vec2 by) {
  const std::vector<Vec2> from = {{0, 0}, {300, 0}, {0, 300}, {300, 300}};
  std::vector<Vec2> to;
  for (const Vec2 p : from) to.push_back({scale * p.x + by.x, scale * p.y + by.y});
  return ThinPlateSpline::Fit(from, to);
}

Mesh MeshOf(const Features& reference, double scale, Vec2 by) {
  return WarpMesh(Warp(scale, by), reference.width, reference.height);
}

std::optional<double> Difference(const Features& query, const Features& reference, double scale = 1,
                                 Vec2 by = {}) {
  const std::vector<Vec2> seen = {{10, 10}, {310, 10}, {310, 310}, {10, 310}};
  return ColourDifference(query, reference, MeshOf(reference, scale, by), seen, scale);
}

TEST(ColourDifference, IsNoneOfTheSame) {
  const Features image = Painted(RedAndBlue);
  EXPECT_NEAR(Difference(image, image).value(), 0, 0.01);
}

TEST(ColourDifference, IsNotTheLights) {
  const Paint warmer = [](double x, double y) {
    const Vec2 chroma = RedAndBlue(x, y);
    return Vec2{chroma.x + 9, chroma.y + 30};
  };
  EXPECT_NEAR(Difference(Painted(warmer), Painted(RedAndBlue)).value(), 0, 0.01);
}

TEST(ColourDifference, IsThatOfTheColours) {
  // Half of it is 84.9 more one way, half the other way; one half is taken for the light.
  EXPECT_GT(Difference(Painted(BlueAndRed), Painted(RedAndBlue)).value(), 60);
}

TEST(ColourDifference, ComparesWhatTheWarpSays) {
  // The query shows the reference at half its size, 100 to the right and 40 down; around it is
  // blue.
  const Paint placed = [](double x, double y) {
    const Vec2 in{(x * kSide - 100) / (kSide / 2.0), (y * kSide - 40) / (kSide / 2.0)};
    const bool inside = in.x > 0 && in.x < 1 && in.y > 0 && in.y < 1;
    return inside ? RedAndBlue(in.x, in.y) : Vec2{128, 68};
  };
  const Features query = Painted(placed);
  const Features reference = Painted(RedAndBlue);
  const double right = Difference(query, reference, 0.5, {100, 40}).value();
  EXPECT_LT(right, 6) << "the cells are coarse";
  EXPECT_GT(Difference(query, reference, 0.5, {20, 120}).value(), right + 10);
}

TEST(ColourDifference, LooksOnlyAtWhatIsSeen) {
  const Paint half = [](double x, double y) { return x < 0.4 ? RedAndBlue(x, y) : Vec2{30, 220}; };
  const Features query = Painted(half);
  const Features reference = Painted(RedAndBlue);
  const std::vector<Vec2> left = {{10, 10}, {90, 10}, {90, 310}, {10, 310}};
  EXPECT_NEAR(ColourDifference(query, reference, MeshOf(reference, 1, {}), left, 1).value(), 0,
              0.01);
  EXPECT_GT(Difference(query, reference).value(), 30);
}

std::optional<double> Relative(const Paint& query, const Paint& reference) {
  const std::vector<Vec2> seen = {{10, 10}, {310, 10}, {310, 310}, {10, 310}};
  const Features image = Painted(reference);
  return RelativeColourDifference(Painted(query), image, MeshOf(image, 1, {}), seen, 1);
}

TEST(ColourDifference, RelativeToTheColoursIsNotTheFading) {
  const auto faded = [](double strength) {
    return [strength](double x, double y) {
      const Vec2 chroma = RedAndBlue(x, y);
      return Vec2{128 + strength * (chroma.x - 128) + 9, 128 + strength * (chroma.y - 128) - 20};
    };
  };
  EXPECT_LT(Relative(faded(0.5), faded(1)).value(), 0.05);
  EXPECT_LT(Relative(faded(1.3), faded(1)).value(), 0.05);
  EXPECT_GT(Relative(BlueAndRed, RedAndBlue).value(), 0.5);
}

TEST(ColourDifference, IsUnknownWithoutColours) {
  const Features image = Painted(RedAndBlue);
  Features grey = image;
  grey.colours = {};
  EXPECT_FALSE(Difference(grey, image));
  EXPECT_FALSE(Difference(image, grey));
  EXPECT_FALSE(Difference(image, image, 1, {1000, 0})) << "outside of the query";
  EXPECT_FALSE(ColourDifference(image, image, MeshOf(image, 1, {}), {}, 1));
}

TEST(ColourDifference, StaysWithinTheImage) {
  const Features query = Painted(RedAndBlue, 160, 400);
  const Features reference = Painted(RedAndBlue, 400, 160);
  for (const double scale : {0.01, 0.3, 1.0, 50.0}) {
    const double difference = Difference(query, reference, scale, {-20, 10}).value_or(0);
    EXPECT_THAT(difference, ::testing::AllOf(::testing::Ge(0), ::testing::Lt(362)));  // a*, b*
  }
}

}  // namespace
}  // namespace pliant
