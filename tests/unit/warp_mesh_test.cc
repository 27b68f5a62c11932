// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "index/json/result_json.h"
#include "index/verify/warp_geometry.h"

namespace pliant {
namespace {

// A spline through a grid of points moved by `move`.
template <typename Move>
ThinPlateSpline Spline(double width, double height, Move move) {
  std::vector<Vec2> from;
  std::vector<Vec2> to;
  for (int r = 0; r <= 5; ++r) {
    for (int c = 0; c <= 5; ++c) {
      from.push_back({width * c / 5, height * r / 5});
      to.push_back(move(from.back()));
    }
  }
  return ThinPlateSpline::Fit(from, to, {.regularization = 0});
}

Vec2 Wave(Vec2 p) { return {p.x / 2 + 20 + 8 * std::sin(p.y / 80), p.y / 2 + 5 * p.x / 300}; }

TEST(WarpMesh, IsTheSplineAtAGridFromCornerToCorner) {
  const auto warp = Spline(320, 240, Wave);
  const Mesh mesh = WarpMesh(warp, 321, 241, 9);
  EXPECT_EQ(mesh.columns, 9);
  EXPECT_EQ(mesh.rows, 7);
  ASSERT_EQ(mesh.points.size(), 63U);
  for (int r = 0; r < mesh.rows; ++r) {
    for (int c = 0; c < mesh.columns; ++c) {
      const Vec2 expected = warp({40.0 * c, 40.0 * r});
      EXPECT_NEAR(mesh.points[static_cast<std::size_t>(r * 9 + c)].x, expected.x, 1e-9);
      EXPECT_NEAR(mesh.points[static_cast<std::size_t>(r * 9 + c)].y, expected.y, 1e-9);
      EXPECT_TRUE(mesh.trusted[static_cast<std::size_t>(r * 9 + c)]);
    }
  }
}

TEST(WarpMesh, TallAndThinImagesHaveAtLeastTwoPointsASide) {
  const auto warp = Spline(20, 400, Wave);
  const Mesh mesh = WarpMesh(warp, 20, 400);
  EXPECT_EQ(mesh.columns, 2);
  EXPECT_EQ(mesh.rows, 17);
  EXPECT_EQ(mesh.reference_point(1, 16), (Vec2{19, 399}));
}

TEST(WarpMesh, PointsWhereTheMapMirrorsAreNotTrusted) {
  // x runs forth to 200 and back again.
  const auto warp =
      Spline(400, 300, [](Vec2 p) { return Vec2{p.x <= 240 ? p.x : 480 - p.x, p.y}; });
  const Mesh mesh = WarpMesh(warp, 401, 301, 17);
  for (int r = 0; r < mesh.rows; ++r) {
    EXPECT_TRUE(mesh.trusted[static_cast<std::size_t>(r * mesh.columns + 4)]);    // x = 100
    EXPECT_FALSE(mesh.trusted[static_cast<std::size_t>(r * mesh.columns + 15)]);  // x = 375
  }
}

TEST(WarpMesh, JsonHasEveryPointInOrder) {
  const Mesh mesh = WarpMesh(Spline(320, 240, Wave), 321, 241, 5);
  const auto json = MeshJson(mesh);
  EXPECT_EQ(json["columns"], 5);
  EXPECT_EQ(json["rows"], 4);
  EXPECT_EQ(json["reference_width"], 321);
  EXPECT_EQ(json["reference_height"], 241);
  ASSERT_EQ(json["points"].size(), mesh.points.size());
  ASSERT_EQ(json["trusted"].size(), mesh.points.size());
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    EXPECT_NEAR(json["points"][i][0].get<double>(), mesh.points[i].x, 0.0051);
    EXPECT_NEAR(json["points"][i][1].get<double>(), mesh.points[i].y, 0.0051);
    EXPECT_EQ(json["trusted"][i].get<bool>(), mesh.trusted[i]);
  }
}

TEST(WarpMesh, RefusesWhatIsNoGrid) {
  const auto warp = Spline(320, 240, Wave);
  EXPECT_THROW(WarpMesh(warp, 1, 100), Error);
  EXPECT_THROW(WarpMesh(warp, 100, 0), Error);
  EXPECT_THROW(WarpMesh(warp, 100, 100, 1), Error);
  EXPECT_THROW(WarpMesh(warp, 100, 100, 100'000), Error);
}

}  // namespace
}  // namespace pliant
