// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "descriptor/evaluation/metrics.h"

namespace pliant::evaluation {
namespace {

using Positions = std::vector<std::optional<Vec2>>;

Keypoint At(float x, float y) { return {.x = x, .y = y, .size = 4}; }

TEST(TruePairs, TakeTheNearestFirstAndEachOnce) {
  const Positions positions = {Vec2{10, 10}, Vec2{11, 10}, std::nullopt, Vec2{50, 50}};
  const std::vector<Keypoint> second = {At(11.2F, 10), At(12, 10), At(53, 50), At(90, 90)};
  const std::vector<TruePair> pairs = FindTruePairs(positions, second, 3);
  ASSERT_EQ(pairs.size(), 3U);
  EXPECT_EQ(pairs[0].first, 1U);  // 0.2 px
  EXPECT_EQ(pairs[0].second, 0U);
  EXPECT_EQ(pairs[1].first, 0U);  // its nearest is taken: 2 px
  EXPECT_EQ(pairs[1].second, 1U);
  EXPECT_EQ(pairs[2].first, 3U);  // exactly 3 px still counts
  EXPECT_EQ(pairs[2].second, 2U);
}

TEST(TruePairs, AgreeWithRepeatedSearchForTheNearest) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> place(0, 40);
  Positions positions;
  std::vector<Keypoint> second;
  for (int i = 0; i < 120; ++i) {
    positions.push_back(i % 7 == 0 ? std::nullopt
                                   : std::optional(Vec2{place(random), place(random)}));
    second.push_back(At(place(random), place(random)));
  }
  std::set<std::pair<std::uint32_t, std::uint32_t>> expected;
  std::set<std::uint32_t> rows, columns;
  for (;;) {
    double best = 3.0;
    std::pair<std::uint32_t, std::uint32_t> nearest{999, 999};
    for (std::uint32_t i = 0; i < positions.size(); ++i) {
      for (std::uint32_t j = 0; j < second.size(); ++j) {
        if (!positions[i] || rows.contains(i) || columns.contains(j)) continue;
        const double d = std::hypot(positions[i]->x - second[j].x, positions[i]->y - second[j].y);
        if (d <= best) {
          best = d;
          nearest = {i, j};
        }
      }
    }
    if (nearest.first == 999) break;
    rows.insert(nearest.first);
    columns.insert(nearest.second);
    expected.insert(nearest);
  }
  std::set<std::pair<std::uint32_t, std::uint32_t>> found;
  for (const TruePair& pair : FindTruePairs(positions, second, 3))
    found.insert({pair.first, pair.second});
  EXPECT_GT(found.size(), 20U);
  EXPECT_EQ(found, expected);
}

TEST(Figures, WorkedByHand) {
  const Positions positions = {Vec2{10, 10}, Vec2{20, 20}, Vec2{30, 30}, std::nullopt,
                               Vec2{70, 70}};
  const std::vector<Keypoint> second = {At(10, 10), At(20, 22), At(31, 30), At(60, 60)};
  const std::vector<TruePair> pairs = FindTruePairs(positions, second, 3);
  ASSERT_EQ(pairs.size(), 3U);
  const auto match = [](std::uint32_t first, std::uint32_t other, bool mutual) {
    return Match{.query = other, .reference = first, .mutual = mutual};
  };
  const std::vector<Match> matches = {
      match(0, 0, true),   // right
      match(1, 1, false),  // right, not mutual
      match(2, 3, true),   // wrong
      match(3, 2, true),   // what is hidden has no right match
      match(4, 3, false),  // seen, but nothing was detected there
  };
  const PairFigures figures = CountMatches(matches, positions, pairs, second, 3);
  EXPECT_EQ(figures.first, 5);
  EXPECT_EQ(figures.second, 4);
  EXPECT_EQ(figures.correct, 2);
  EXPECT_DOUBLE_EQ(figures.ms(), 2.0 / 4);
  EXPECT_DOUBLE_EQ(figures.mma(), 2.0 / 3);
  EXPECT_DOUBLE_EQ(figures.mutual_precision(), 1.0 / 3);
}

TEST(Figures, AMatchNearTheTruePlaceIsRightEvenIfAnotherIsThePartner) {
  const Positions positions = {Vec2{10, 10}};
  const std::vector<Keypoint> second = {At(10, 10.1F), At(10, 12)};
  const std::vector<TruePair> pairs = FindTruePairs(positions, second, 3);
  const std::vector<Match> matches = {{.query = 1, .reference = 0}};
  const PairFigures figures = CountMatches(matches, positions, pairs, second, 3);
  EXPECT_EQ(figures.correct, 1);
  EXPECT_DOUBLE_EQ(figures.mma(), 1);
}

TEST(Figures, NothingToCountIsZeroNotNan) {
  const PairFigures figures = CountMatches({}, {}, {}, {}, 3);
  EXPECT_EQ(figures.ms(), 0);
  EXPECT_EQ(figures.mma(), 0);
  EXPECT_EQ(figures.mutual_precision(), 0);
}

}  // namespace
}  // namespace pliant::evaluation
