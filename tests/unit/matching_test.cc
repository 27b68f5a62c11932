// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/match/matching.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "tests/unit/random_descriptors.h"

namespace pliant {
namespace {

using testing::PlainDistance;
using testing::RandomBits;
using testing::RandomGrid;

// Values on which both sides are exact, with many ties.
void ExpectBruteForce(const Descriptors& query, const Descriptors& reference) {
  const auto matches = MatchDescriptors(PackedDescriptors(query), reference);
  ASSERT_EQ(matches.size(), reference.rows);
  const auto nearest = [](const Descriptors& from, std::size_t i, const Descriptors& to) {
    std::vector<std::pair<double, std::uint32_t>> all;
    for (std::uint32_t j = 0; j < to.rows; ++j) all.emplace_back(PlainDistance(from, i, to, j), j);
    std::sort(all.begin(), all.end());
    return all;
  };
  for (std::uint32_t i = 0; i < reference.rows; ++i) {
    const auto forth = nearest(reference, i, query);
    ASSERT_EQ(matches[i].reference, i);
    ASSERT_EQ(matches[i].query, forth[0].second);
    ASSERT_FLOAT_EQ(matches[i].distance, static_cast<float>(forth[0].first));
    const double ratio = forth[1].first > 0 ? forth[0].first / forth[1].first : 1;
    ASSERT_NEAR(matches[i].ratio, ratio, 1e-6);
    ASSERT_EQ(matches[i].mutual, nearest(query, matches[i].query, reference)[0].second == i);
  }
}

TEST(Matching, AgreesWithSortingAll) {
  ExpectBruteForce(RandomGrid(300, 6, 4, 1), RandomGrid(700, 6, 4, 2));
  ExpectBruteForce(RandomBits(300, 2, 3), RandomBits(600, 2, 4));
  ExpectBruteForce(RandomBits(90, 32, 5), RandomBits(33, 32, 6));
}

TEST(Matching, FiltersAndThreads) {
  const PackedDescriptors query(RandomBits(500, 4, 1));
  const auto reference = RandomBits(1500, 4, 2);
  const auto all = MatchDescriptors(query, reference);
  for (const int threads : {1, 2, 3}) {
    const auto some = MatchDescriptors(
        query, reference, {.max_ratio = 0.8F, .mutual_only = true, .threads = threads});
    std::size_t next = 0;
    for (const Match& m : all) {
      if (m.ratio > 0.8F || !m.mutual) continue;
      ASSERT_LT(next, some.size());
      EXPECT_EQ(some[next].reference, m.reference);
      EXPECT_EQ(some[next].query, m.query);
      ++next;
    }
    EXPECT_EQ(next, some.size());
    EXPECT_GT(next, 0U);
  }
}

TEST(Matching, FewOrNone) {
  const auto some = RandomGrid(3, 4, 5, 1);
  EXPECT_TRUE(MatchDescriptors(PackedDescriptors(some), Descriptors::Float(0, 4)).empty());
  EXPECT_TRUE(MatchDescriptors(PackedDescriptors(Descriptors::Float(0, 4)), some).empty());
  const auto one = MatchDescriptors(PackedDescriptors(RandomGrid(1, 4, 5, 1)), some);
  ASSERT_EQ(one.size(), 3U);
  EXPECT_EQ(one[0].ratio, 0);
  EXPECT_EQ(one[0].distance, 0);
  EXPECT_TRUE(one[0].mutual);
  EXPECT_FALSE(one[1].mutual);
}

TEST(Matching, RefusesBadOptions) {
  const auto some = RandomGrid(3, 4, 5, 1);
  for (const float ratio : {0.0F, -1.0F, 1.5F}) {
    EXPECT_THROW(MatchDescriptors(PackedDescriptors(some), some, {.max_ratio = ratio}), Error);
  }
  EXPECT_THROW(MatchDescriptors(PackedDescriptors(some), RandomGrid(3, 5, 5, 1)), Error);
}

}  // namespace
}  // namespace pliant
