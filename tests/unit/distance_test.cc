// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/match/distance.h"

#include <functional>
#include <limits>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "descriptor/match/distance_kernels.h"
#include "tests/unit/nearest_oracle.h"
#include "tests/unit/random_descriptors.h"

namespace pliant::testing {
namespace {

struct Shape {
  std::size_t queries;
  std::size_t rows;
  int dim;
};

class DistanceShapes : public ::testing::TestWithParam<Shape> {};

void ExpectDistances(const Descriptors& a, const Descriptors& b, double tolerance) {
  const PackedDescriptors packed(b);
  std::vector<float> out(a.rows * b.rows, -1.0F);
  packed.Distances(a, 0, a.rows, out.data());
  for (std::size_t i = 0; i < a.rows; ++i) {
    for (std::size_t j = 0; j < b.rows; ++j) {
      ASSERT_NEAR(out[i * b.rows + j], PlainDistance(a, i, b, j), tolerance) << i << ", " << j;
    }
  }
}

TEST_P(DistanceShapes, AgreeWithTheDefinition) {
  const auto [queries, rows, dim] = GetParam();
  ExpectDistances(RandomFloats(queries, dim, 1), RandomFloats(rows, dim, 2), 1e-4);
  ExpectDistances(RandomBits(queries, dim, 3), RandomBits(rows, dim, 4), 0);
}

TEST_P(DistanceShapes, ByProductTheyAreSquaredFloats) {
  const auto [queries, rows, dim] = GetParam();
  const Descriptors a = RandomGrid(queries, dim, 3, 9);
  const Descriptors b = RandomGrid(rows, dim, 3, 10);
  std::vector<float> squared(queries * rows);
  PackedDescriptors(b).DistancesByProduct(a, 0, queries, squared.data());
  const Descriptors c = RandomBits(queries, dim, 11);
  const Descriptors d = RandomBits(rows, dim, 12);
  std::vector<float> bits(queries * rows);
  PackedDescriptors(d).DistancesByProduct(c, 0, queries, bits.data());
  for (std::size_t i = 0; i < queries; ++i) {
    for (std::size_t j = 0; j < rows; ++j) {
      const double distance = PlainDistance(a, i, b, j);
      ASSERT_NEAR(squared[i * rows + j], distance * distance, 1e-3);
      ASSERT_EQ(bits[i * rows + j], PlainDistance(c, i, d, j));
    }
  }
}

void ExpectNearestOfPacked(const Descriptors& a, const Descriptors& b) {
  const PackedDescriptors packed(b);
  std::vector<NearestTwo> nearest(a.rows);
  std::vector<NearestOne> back(b.rows);
  packed.FindNearest(a, 0, a.rows, nearest.data(), back.data());
  ExpectNearest(a, b, nearest, back);
}

TEST_P(DistanceShapes, NearestAgreeWithSortingAll) {
  const auto [queries, rows, dim] = GetParam();
  ExpectNearestOfPacked(RandomGrid(queries, dim, 3, 5), RandomGrid(rows, dim, 3, 6));
  ExpectNearestOfPacked(RandomBits(queries, dim, 7), RandomBits(rows, dim, 8));
}

INSTANTIATE_TEST_SUITE_P(Shapes, DistanceShapes,
                         ::testing::Values(Shape{1, 1, 1}, Shape{3, 31, 2}, Shape{64, 32, 4},
                                           Shape{65, 33, 7}, Shape{130, 200, 8}, Shape{9, 100, 32},
                                           Shape{20, 70, 61}, Shape{70, 129, 128}));

TEST(Distance, DependsOnTheRowsOnly) {
  const auto a = RandomFloats(97, 128, 11);
  const PackedDescriptors packed(a);
  std::vector<float> all(a.rows * a.rows);
  packed.Distances(a, 0, a.rows, all.data());
  std::vector<float> one(a.rows);
  for (std::size_t i = 0; i < a.rows; ++i) {
    ASSERT_EQ(all[i * a.rows + i], 0.0F);
    packed.Distances(a, i, 1, one.data());
    for (std::size_t j = 0; j < a.rows; ++j) {
      ASSERT_EQ(all[i * a.rows + j], all[j * a.rows + i]) << i << ", " << j;
      ASSERT_EQ(all[i * a.rows + j], one[j]) << i << ", " << j;
    }
  }
  // The product's form too is exactly 0 for a row and itself, in every position.
  std::vector<NearestTwo> nearest(a.rows);
  packed.FindNearest(a, 0, a.rows, nearest.data());
  for (std::size_t i = 0; i < a.rows; ++i) {
    ASSERT_EQ(nearest[i].index, i);
    ASSERT_EQ(nearest[i].distance, 0.0F);
  }
}

TEST(Distance, SelectsRows) {
  const auto a = RandomFloats(5, 3, 1);
  const std::vector<std::uint32_t> rows = {4, 0, 4};
  const auto b = SelectRows(a, rows);
  ASSERT_EQ(b.rows, 3U);
  EXPECT_THAT(b.float_row(0), ::testing::ElementsAreArray(a.float_row(4)));
  EXPECT_THAT(b.float_row(1), ::testing::ElementsAreArray(a.float_row(0)));
  EXPECT_THAT(b.float_row(2), ::testing::ElementsAreArray(a.float_row(4)));
}

ErrorCode CodeOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& e) {
    return e.code();
  }
  return ErrorCode::kInternal;
}

TEST(Distance, RefusesWhatDoesNotFit) {
  const PackedDescriptors packed(RandomFloats(4, 8, 1));
  NearestTwo nearest[9];
  EXPECT_EQ(CodeOf([&] { packed.FindNearest(RandomFloats(4, 9, 1), 0, 4, nearest); }),
            ErrorCode::kConflict);
  EXPECT_EQ(CodeOf([&] { packed.FindNearest(RandomBits(4, 8, 1), 0, 4, nearest); }),
            ErrorCode::kConflict);
  EXPECT_EQ(CodeOf([&] { packed.FindNearest(RandomFloats(4, 8, 1), 2, 3, nearest); }),
            ErrorCode::kInvalidArgument);
  auto broken = RandomFloats(4, 8, 1);
  broken.floats[17] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(CodeOf([&] { CheckDescriptors(broken, "x"); }), ErrorCode::kInvalidArgument);
  broken.floats[17] = -std::numeric_limits<float>::infinity();
  EXPECT_EQ(CodeOf([&] { CheckDescriptors(broken, "x"); }), ErrorCode::kInvalidArgument);
  broken.floats.resize(31);
  EXPECT_EQ(CodeOf([&] { CheckDescriptors(broken, "x"); }), ErrorCode::kInvalidArgument);
}

TEST(Distance, NoRowsAreInfinitelyFar) {
  const PackedDescriptors packed(Descriptors::Float(0, 8));
  NearestTwo nearest[4];
  packed.FindNearest(RandomFloats(4, 8, 1), 0, 4, nearest);
  EXPECT_EQ(nearest[3].distance, std::numeric_limits<float>::infinity());
}

}  // namespace
}  // namespace pliant::testing
