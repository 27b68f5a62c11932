// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/match/stepped.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "descriptor/match/distance_kernels.h"
#include "descriptor/match/matching.h"
#include "tests/unit/nearest_oracle.h"
#include "tests/unit/random_descriptors.h"

namespace pliant::testing {
namespace {

using kernels::kPanel;
using kernels::StepKernels;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Rows of whole steps, the largest of them 127, times a scale of their own.
Descriptors RandomSteps(std::size_t rows, int dim, std::uint64_t seed, bool one_scale = false) {
  std::mt19937_64 generator(seed);
  auto out = Descriptors::Float(rows, dim);
  for (std::size_t r = 0; r < rows; ++r) {
    const float random = 0.0001F * static_cast<float>(1 + generator() % 5000);
    const float scale = one_scale ? 0.5F : random;
    for (int p = 0; p < dim; ++p) {
      const int step =
          p == 0 ? (generator() % 2 == 0 ? 127 : -127) : static_cast<int>(generator() % 255) - 127;
      out.floats[r * dim + p] = scale * static_cast<float>(step);
    }
  }
  return out;
}

SteppedDescriptors Steps(const Descriptors& descriptors) {
  auto steps = SteppedDescriptors::Of(descriptors);
  if (!steps) throw std::runtime_error("no whole steps");
  return *steps;
}

class Stepped : public ::testing::Test {
 protected:
  void SetUp() override {
    if (StepKernels().empty()) GTEST_SKIP() << "This processor compares floats faster.";
  }
};

TEST_F(Stepped, AgreesWithSortingAll) {
  for (const auto& [queries, rows, dim] : std::vector<std::tuple<int, int, int>>{{1, 1, 1},
                                                                                 {3, 31, 2},
                                                                                 {64, 32, 4},
                                                                                 {65, 33, 7},
                                                                                 {130, 200, 8},
                                                                                 {20, 70, 61},
                                                                                 {70, 129, 128},
                                                                                 {9, 40, 1024}}) {
    // With one scale every sum is exact, and with few components ties abound.
    const auto a = RandomSteps(queries, dim, 1, true);
    const auto b = RandomSteps(rows, dim, 2, true);
    std::vector<NearestTwo> nearest(a.rows);
    std::vector<NearestOne> back(b.rows);
    Steps(b).FindNearest(Steps(a), 0, a.rows, nearest.data(), back.data());
    ExpectNearest(a, b, nearest, back);
  }
}

TEST_F(Stepped, DistancesAgreeWithTheDefinition) {
  const auto a = RandomSteps(70, 128, 3);
  const auto b = RandomSteps(90, 128, 4);
  std::vector<NearestTwo> nearest(a.rows);
  Steps(b).FindNearest(Steps(a), 0, a.rows, nearest.data());
  for (std::size_t i = 0; i < a.rows; ++i) {
    double best = 1e30;
    for (std::size_t j = 0; j < b.rows; ++j) best = std::min(best, PlainDistance(a, i, b, j));
    ASSERT_NEAR(nearest[i].distance, best, 1e-5 * best);
  }
}

TEST_F(Stepped, DependsOnTheRowsOnly) {
  const auto a = RandomSteps(97, 61, 5);
  const auto steps = Steps(a);
  std::vector<NearestTwo> nearest(a.rows);
  std::vector<NearestOne> back(a.rows);
  steps.FindNearest(steps, 0, a.rows, nearest.data(), back.data());
  for (std::size_t i = 0; i < a.rows; ++i) {
    ASSERT_EQ(nearest[i].index, i);
    ASSERT_EQ(nearest[i].distance, 0.0F);
    ASSERT_EQ(back[i].index, i);
    // d(a, b) == d(b, a), and alone as among all.
    const std::uint32_t row[] = {static_cast<std::uint32_t>(i)};
    const auto one = Steps(SelectRows(a, row));
    const std::uint32_t other[] = {static_cast<std::uint32_t>((i + 40) % a.rows)};
    const auto two = Steps(SelectRows(a, other));
    NearestTwo forth;
    NearestTwo back_again;
    one.FindNearest(two, 0, 1, &forth);
    two.FindNearest(one, 0, 1, &back_again);
    ASSERT_EQ(forth.distance, back_again.distance);
    std::vector<NearestTwo> again(1);
    steps.FindNearest(steps, i, 1, again.data());
    ASSERT_EQ(again[0].second, nearest[i].second);
  }
}

TEST_F(Stepped, EveryInstructionSetGivesTheSame) {
  for (const int rows : {1, 7, 8, 23}) {
    for (const std::size_t groups : {1, 5, 32, 256}) {
      std::mt19937 generator(static_cast<unsigned>(rows));
      const auto fill = [&](std::size_t n) {
        std::vector<std::int8_t> steps(n * groups * 4);
        for (auto& s : steps)
          s = static_cast<std::int8_t>(static_cast<int>(generator() % 255) - 127);
        // The largest sums there can be.
        std::fill_n(steps.begin(), groups * 4, static_cast<std::int8_t>(n % 2 == 0 ? 127 : -127));
        return steps;
      };
      const auto a = fill(rows);
      const auto panel = fill(kPanel);
      std::vector<std::int32_t> sums(rows, 0);
      for (std::size_t i = 0; i < a.size(); ++i) sums[i / (groups * 4)] += a[i];
      const std::vector<float> scales(kPanel, 1);
      const std::vector<float> norms(kPanel, 1e9F);
      for (const auto& set : StepKernels()) {
        std::vector<float> out(rows * kPanel);
        set.squared_tile({a.data(), scales.data(), sums.data(), norms.data()}, rows, groups,
                         {panel.data(), scales.data(), norms.data()}, out.data());
        for (int r = 0; r < rows; ++r) {
          for (std::size_t j = 0; j < kPanel; ++j) {
            std::int32_t dot = 0;
            for (std::size_t p = 0; p < groups * 4; ++p) {
              dot += a[r * groups * 4 + p] * panel[(p / 4 * kPanel + j) * 4 + p % 4];
            }
            ASSERT_EQ(out[r * kPanel + j], std::fma(-2.0F, static_cast<float>(dot), 2e9F))
                << set.name << ", row " << r << ", column " << j;
          }
        }
      }
    }
  }
}

TEST_F(Stepped, WhatIsNotOfWholeStepsIsRefused) {
  EXPECT_FALSE(SteppedDescriptors::Of(RandomFloats(5, 16, 1)));
  EXPECT_FALSE(SteppedDescriptors::Of(RandomBits(5, 16, 1)));
  EXPECT_FALSE(SteppedDescriptors::Of(RandomSteps(5, 1025, 1)));
  EXPECT_TRUE(SteppedDescriptors::Of(RandomSteps(5, 1024, 1)));
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), kInfinity, 3e38F, 1e-38F}) {
    auto one = Descriptors::Float(3, 4);
    one.floats[5] = bad;
    EXPECT_FALSE(SteppedDescriptors::Of(one)) << bad;
  }
  auto off = RandomSteps(5, 16, 1);
  off.floats[70] *= 1.001F;
  EXPECT_FALSE(SteppedDescriptors::Of(off));
  EXPECT_TRUE(SteppedDescriptors::Of(Descriptors::Float(3, 4)));  // all zeros
}

TEST_F(Stepped, NoRowsAreInfinitelyFarAndWhatDoesNotFitIsRefused) {
  const auto none = Steps(Descriptors::Float(0, 8));
  const auto some = Steps(RandomSteps(4, 8, 1));
  NearestTwo nearest[4];
  none.FindNearest(some, 0, 4, nearest);
  EXPECT_EQ(nearest[3].distance, kInfinity);
  EXPECT_THROW(some.FindNearest(Steps(RandomSteps(4, 9, 1)), 0, 4, nearest), Error);
  EXPECT_THROW(some.FindNearest(some, 2, 3, nearest), Error);
}

TEST_F(Stepped, MatchesAsFloatsDo) {
  const auto query = RandomSteps(700, 32, 1);
  auto reference = RandomSteps(300, 32, 2);
  std::copy_n(query.floats.begin(), 100 * 32, reference.floats.begin() + 50 * 32);
  const auto by_floats = MatchDescriptors(PackedDescriptors(query), reference);
  for (const int threads : {1, 2, 3}) {
    const auto matches = MatchDescriptors(Steps(query), Steps(reference), {.threads = threads});
    ASSERT_EQ(matches.size(), by_floats.size());
    for (std::size_t i = 0; i < matches.size(); ++i) {
      ASSERT_EQ(matches[i].query, by_floats[i].query);
      ASSERT_EQ(matches[i].reference, by_floats[i].reference);
      ASSERT_EQ(matches[i].mutual, by_floats[i].mutual);
      ASSERT_NEAR(matches[i].distance, by_floats[i].distance, 2e-3 * by_floats[i].distance + 1e-3);
      ASSERT_NEAR(matches[i].ratio, by_floats[i].ratio, 1e-3);
    }
  }
}

}  // namespace
}  // namespace pliant::testing
