// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/warp/tps.h"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

std::vector<Vec2> RandomPoints(std::size_t n, double size, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::uniform_real_distribution<double> uniform(0, size);
  std::vector<Vec2> points(n);
  for (Vec2& p : points) p = {uniform(generator), uniform(generator)};
  return points;
}

Vec2 Bend(Vec2 p) {
  return {1.3 * p.x + 0.2 * p.y + 12 * std::sin(p.y / 60) + 40,
          -0.1 * p.x + 0.9 * p.y + 9 * std::cos(p.x / 70) - 11};
}

std::vector<Vec2> Map(const std::vector<Vec2>& points, Vec2 (*f)(Vec2)) {
  std::vector<Vec2> out;
  for (const Vec2 p : points) out.push_back(f(p));
  return out;
}

TEST(Tps, GoesThroughThePointsWithoutRegularization) {
  const auto from = RandomPoints(40, 500, 1);
  const auto to = Map(from, Bend);
  const auto f = ThinPlateSpline::Fit(from, to, {.regularization = 0});
  for (std::size_t i = 0; i < from.size(); ++i) {
    EXPECT_NEAR(f(from[i]).x, to[i].x, 1e-3);
    EXPECT_NEAR(f(from[i]).y, to[i].y, 1e-3);
  }
  EXPECT_GT(f.bending_energy(), 1e-4);
}

TEST(Tps, ReproducesAffineMapsWhateverTheRegularization) {
  const auto affine = [](Vec2 p) { return Vec2{2 * p.x - 0.5 * p.y + 7, 0.25 * p.x + p.y - 90}; };
  const auto from = RandomPoints(80, 300, 2);
  const auto to = Map(from, affine);
  for (const double lambda : {0.0, 1e-3, 1.0, 1e6}) {
    const auto f = ThinPlateSpline::Fit(from, to, {.regularization = lambda});
    EXPECT_NEAR(f.bending_energy(), 0, 1e-12);
    for (const Vec2 p : {Vec2{0, 0}, Vec2{1000, -400}, Vec2{150, 150}}) {
      EXPECT_NEAR(f(p).x, affine(p).x, 1e-5);
      EXPECT_NEAR(f(p).y, affine(p).y, 1e-5);
      const auto j = f.Jacobian(p);
      EXPECT_NEAR(j[0], 2, 1e-7);
      EXPECT_NEAR(j[1], -0.5, 1e-7);
      EXPECT_NEAR(j[2], 0.25, 1e-7);
      EXPECT_NEAR(j[3], 1, 1e-7);
    }
  }
}

TEST(Tps, LearnsASmoothWarpFromManyNoisyPoints) {
  auto from = RandomPoints(600, 500, 3);
  auto to = Map(from, Bend);
  std::mt19937_64 generator(4);
  std::normal_distribution<double> noise(0, 1.0);
  for (Vec2& p : to) p = {p.x + noise(generator), p.y + noise(generator)};
  const auto f = ThinPlateSpline::Fit(from, to, {.regularization = 1e-5});
  double worst = 0;
  for (const Vec2 p : RandomPoints(200, 500, 5)) {
    worst = std::max(worst, std::hypot(f(p).x - Bend(p).x, f(p).y - Bend(p).y));
  }
  EXPECT_LT(worst, 2.5);
}

TEST(Tps, JacobianIsTheDerivative) {
  const auto from = RandomPoints(30, 400, 6);
  const auto f = ThinPlateSpline::Fit(from, Map(from, Bend), {.regularization = 1e-4});
  constexpr double kStep = 1e-3;
  auto where = RandomPoints(20, 400, 7);
  where.push_back(from[0]);  // at a control point
  for (const Vec2 p : where) {
    const auto j = f.Jacobian(p);
    const Vec2 right = f({p.x + kStep, p.y});
    const Vec2 left = f({p.x - kStep, p.y});
    const Vec2 down = f({p.x, p.y + kStep});
    const Vec2 up = f({p.x, p.y - kStep});
    EXPECT_NEAR(j[0], (right.x - left.x) / (2 * kStep), 1e-5);
    EXPECT_NEAR(j[1], (down.x - up.x) / (2 * kStep), 1e-5);
    EXPECT_NEAR(j[2], (right.y - left.y) / (2 * kStep), 1e-5);
    EXPECT_NEAR(j[3], (down.y - up.y) / (2 * kStep), 1e-5);
  }
}

TEST(Tps, MoreRegularizationBendsLess) {
  const auto from = RandomPoints(40, 500, 8);
  const auto to = Map(from, Bend);
  double before = std::numeric_limits<double>::infinity();
  for (const double lambda : {0.0, 1e-4, 1e-2, 1.0}) {
    const double energy =
        ThinPlateSpline::Fit(from, to, {.regularization = lambda}).bending_energy();
    EXPECT_LT(energy, before);
    before = energy;
  }
}

TEST(Tps, WeightsCount) {
  auto from = RandomPoints(50, 500, 9);
  auto to = Map(from, Bend);
  const auto clean = ThinPlateSpline::Fit(from, to);
  from.push_back({250, 250});
  to.push_back({-9000, 4000});
  std::vector<double> weights(from.size(), 1.0);
  weights.back() = 0;
  const auto f = ThinPlateSpline::Fit(from, to, {}, weights);
  EXPECT_NEAR(f({250, 250}).x, clean({250, 250}).x, 1e-6);
  // A weight of 2 is a point given twice.
  weights.assign(from.size(), 1.0);
  weights[3] = 2;
  const TpsOptions smooth{.regularization = 0.1};
  const auto weighted = ThinPlateSpline::Fit(from, to, smooth, weights);
  from.push_back(from[3]);
  to.push_back(to[3]);
  const auto twice = ThinPlateSpline::Fit(from, to, smooth);
  EXPECT_NEAR(weighted({100, 300}).x, twice({100, 300}).x, 1e-4);
}

TEST(Tps, DuplicatesAreNoTrouble) {
  auto from = RandomPoints(10, 100, 10);
  auto to = Map(from, Bend);
  for (int i = 0; i < 30; ++i) {
    from.push_back(from[i % 10]);
    to.push_back({to[i % 10].x + 0.5 * (i % 3), to[i % 10].y});
  }
  const auto f = ThinPlateSpline::Fit(from, to, {.regularization = 0});
  for (int i = 0; i < 10; ++i) EXPECT_NEAR(f(from[i]).x, to[i].x + 0.5, 1.0);
}

template <typename Action>
void ExpectError(ErrorCode code, Action&& action) {
  try {
    action();
    ADD_FAILURE() << "accepted";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), code) << e.what();
  }
}

TEST(Tps, RefusesDegenerateAndBadInput) {
  const auto fit = [](const std::vector<Vec2>& from, const TpsOptions& options = {}) {
    return ThinPlateSpline::Fit(from, from, options);
  };
  std::vector<Vec2> line;
  for (int i = 0; i < 20; ++i) line.push_back({3.0 * i, 100 - 2.0 * i});
  for (const auto& points :
       {std::vector<Vec2>{}, std::vector<Vec2>{{1, 2}}, std::vector<Vec2>{{1, 2}, {3, 4}}, line,
        std::vector<Vec2>(9, Vec2{5, 5})}) {
    ExpectError(ErrorCode::kUnprocessable, [&] { fit(points); });
  }
  const auto good = RandomPoints(9, 100, 1);
  ExpectError(ErrorCode::kInvalidArgument, [&] { fit(good, {.regularization = -1}); });
  ExpectError(ErrorCode::kInvalidArgument, [&] { fit(good, {.max_control_points = 2}); });
  auto bad = good;
  bad[4].y = std::numeric_limits<double>::quiet_NaN();
  ExpectError(ErrorCode::kInvalidArgument, [&] { fit(bad); });
  bad.pop_back();
  ExpectError(ErrorCode::kInvalidArgument, [&] { ThinPlateSpline::Fit(good, bad); });
}

}  // namespace
}  // namespace pliant
