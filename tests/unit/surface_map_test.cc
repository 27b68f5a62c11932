// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "descriptor/evaluation/truth_scene.h"

namespace pliant::evaluation {
namespace {

constexpr int kWidth = 120;
constexpr int kHeight = 90;

// An image of a surface: coordinates by pixel position.
template <typename At>
SurfaceMap MakeMap(const At& at) {
  SurfaceMap map{kWidth, kHeight, {}};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) map.points.push_back(at(x, y));
  }
  return map;
}

// Bent smoothly: turned by 30 degrees, shrunk, and bulging.
SurfacePoint Bent(double x, double y) {
  const double u = 0.6 * (0.866 * x - 0.5 * y) + 2 * std::sin(0.05 * y);
  const double v = 0.6 * (0.5 * x + 0.866 * y) + 2 * std::sin(0.04 * x);
  return {1, {static_cast<float>(u), static_cast<float>(v), static_cast<float>(0.002 * u * v)}};
}

double Off(const std::optional<Vec2>& found, double x, double y) {
  return found ? std::hypot(found->x - x, found->y - y) : 1e9;
}

TEST(SurfaceMap, EveryPixelIsFoundWhereItIs) {
  const SurfaceMap map = MakeMap([](int x, int y) { return Bent(x, y); });
  const SurfaceIndex index(map);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x)
      ASSERT_LT(Off(index.Find(map.Pixel(x, y)), x, y), 1e-3) << x << ", " << y;
  }
}

TEST(SurfaceMap, PointsBetweenPixelsAreFoundToAHundredthOfAPixel) {
  const SurfaceMap map = MakeMap([](int x, int y) { return Bent(x, y); });
  const SurfaceIndex index(map);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> x_of(1, kWidth - 2), y_of(1, kHeight - 2);
  for (int i = 0; i < 2000; ++i) {
    const double x = x_of(random);
    const double y = y_of(random);
    EXPECT_LT(Off(index.Find(Bent(x, y)), x, y), 0.01);
    const std::optional<SurfacePoint> located = map.Locate({x, y});
    ASSERT_TRUE(located);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(located->at[c], Bent(x, y).at[c], 0.01);
  }
}

TEST(SurfaceMap, ObliqueViewsFindTheNearestPixelNotTheNearestCoordinates) {
  // Along x a pixel is ten times as far as along y, and the two are sheared.
  const auto oblique = [](double x, double y) {
    return SurfacePoint{1, {static_cast<float>(10 * x + 3 * y), static_cast<float>(y), 0}};
  };
  const SurfaceMap map = MakeMap([&](int x, int y) { return oblique(x, y); });
  const SurfaceIndex index(map);
  for (double shift = -0.45; shift < 0.5; shift += 0.1)
    EXPECT_LT(Off(index.Find(oblique(40 + shift, 30 + shift)), 40 + shift, 30 + shift), 1e-3);
}

TEST(SurfaceMap, HiddenPointsAreNotFound) {
  // A strip of the surface is covered by something else, and the left edge by another surface.
  const SurfaceMap map = MakeMap([](int x, int y) {
    SurfacePoint point = Bent(x, y);
    if (x >= 50 && x < 60) point.label = 0;
    if (x < 5) point.label = 2;
    return point;
  });
  const SurfaceIndex index(map);
  EXPECT_FALSE(index.Find(Bent(55, 40)));
  EXPECT_FALSE(index.Find(Bent(2, 40)));
  EXPECT_FALSE(index.Find(Bent(-5, 40)));  // outside the image
  EXPECT_FALSE(index.Find({0, {}}));
  EXPECT_FALSE(index.Find({3, Bent(70, 40).at}));
  EXPECT_LT(Off(index.Find(Bent(48.7, 40)), 48.7, 40), 0.01);
  EXPECT_FALSE(map.Locate({55, 40}));
  EXPECT_EQ(map.LabelAt({2, 40}), 2U);
  EXPECT_EQ(map.LabelAt({-1, 40}), 0U);
  EXPECT_EQ(map.LabelAt({1e30, 40}), 0U);
  EXPECT_EQ(map.LabelAt({NAN, 40}), 0U);
}

TEST(SurfaceMap, FoldsDoNotMixTheirTwoSides) {
  // From x = 60 on the image shows a part of the surface far away.
  const auto folded = [](double x, double y) {
    SurfacePoint point = Bent(x, y);
    if (x > 59.5) point.at[0] += 40;
    return point;
  };
  const SurfaceMap map = MakeMap([&](int x, int y) { return folded(x, y); });
  for (const double x : {58.6, 59.4, 59.6, 60.4}) {
    const std::optional<SurfacePoint> located = map.Locate({x, 30.3});
    ASSERT_TRUE(located);
    EXPECT_NEAR(located->at[0], folded(x, 30.3).at[0], 0.02) << x;
  }
}

TEST(SurfaceMap, PointsTooFarFromAnyPixelAreNotFound) {
  const SurfaceMap map = MakeMap([](int x, int y) { return Bent(x, y); });
  SurfacePoint beside = Bent(50, 50);
  beside.at[2] += 5;  // off the surface
  EXPECT_TRUE(SurfaceIndex(map).Find(beside));
  EXPECT_FALSE(SurfaceIndex(map, 1.0F).Find(beside));
}

TEST(SurfaceMap, EmptyImagesFindNothing) {
  const SurfaceMap map = MakeMap([](int, int) { return SurfacePoint{}; });
  EXPECT_FALSE(SurfaceIndex(map).Find(Bent(5, 5)));
}

}  // namespace
}  // namespace pliant::evaluation
