// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Coarse-to-fine search of large vocabularies against trying all words.
#include <algorithm>
#include <numeric>
#include <random>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/random_descriptors.h"
#include "vocab/quantizer.h"

namespace pliant::testing {
namespace {

constexpr std::size_t kWanted = 16;

// `rows` floats in clusters, as descriptors of photographs are.
Descriptors Clustered(std::size_t rows, int dim, std::uint64_t seed) {
  const Descriptors centres = RandomFloats(300, dim, 77);
  Descriptors result = RandomFloats(rows, dim, seed);
  std::mt19937_64 random(seed);
  for (std::size_t i = 0; i < rows; ++i) {
    const auto centre = centres.float_row(random() % centres.rows);
    for (std::size_t d = 0; d < centre.size(); ++d) {
      float& x = result.floats[i * centre.size() + d];
      x = centre[d] + 0.5F * x;
    }
  }
  return result;
}

std::shared_ptr<const Vocabulary> MakeVocabulary(Descriptors words) {
  auto vocabulary = std::make_shared<Vocabulary>();
  vocabulary->words = std::move(words);
  vocabulary->model_id = "test:1";
  return vocabulary;
}

TEST(WordGroups, FindNearlyAllOfTheNearestWords) {
  const Descriptors words = Clustered(WordGroups::kLeastWords, 32, 1);
  const Descriptors rows = Clustered(200, 32, 2);
  const WordGroups groups(words);
  std::vector<NearWord> found(rows.rows * kWanted);
  groups.FindNearest(rows, 0, rows.rows, kWanted, found.data());
  std::size_t right = 0;
  for (std::size_t i = 0; i < rows.rows; ++i) {
    std::vector<double> distances(words.rows);
    for (std::size_t w = 0; w < words.rows; ++w) {
      distances[w] = PlainDistance(rows, i, words, w);
    }
    std::vector<double> sorted = distances;
    std::sort(sorted.begin(), sorted.end());
    std::set<std::uint32_t> different;
    for (std::size_t k = 0; k < kWanted; ++k) {
      const NearWord& near = found[i * kWanted + k];
      ASSERT_NEAR(near.distance, distances[near.word], 1e-3) << "row " << i;
      if (k > 0) {
        EXPECT_GE(near.distance, found[i * kWanted + k - 1].distance);
      }
      different.insert(near.word);
      right += distances[near.word] <= sorted[kWanted - 1] ? 1U : 0U;
    }
    EXPECT_EQ(different.size(), kWanted);
  }
  EXPECT_GT(right, rows.rows * kWanted * 9 / 10);
}

std::vector<std::uint32_t> Nearest(const Quantizer& quantizer, const Descriptors& rows, int count,
                                   int threads = 1) {
  std::vector<std::uint32_t> words;
  for (const NearWord& near : quantizer.NearestWords(rows, count, threads)) {
    words.push_back(near.word);
  }
  return words;
}

TEST(WordGroups, AWordIsItsOwnNearest) {
  for (const bool binary : {false, true}) {
    const Descriptors words = binary ? RandomBits(WordGroups::kLeastWords, 8, 3)
                                     : Clustered(WordGroups::kLeastWords, 16, 3);
    const std::vector<std::uint32_t> assigned = Quantizer(MakeVocabulary(words)).Assign(words);
    std::vector<std::uint32_t> expected(words.rows);
    std::iota(expected.begin(), expected.end(), 0U);
    EXPECT_EQ(assigned, expected);
  }
}

TEST(WordGroups, TheAnswerDependsNeitherOnThreadsNorOnOtherRows) {
  const Quantizer quantizer(MakeVocabulary(Clustered(WordGroups::kLeastWords, 16, 4)));
  const Descriptors rows = Clustered(150, 16, 5);
  const auto one = Nearest(quantizer, rows, kWanted);
  EXPECT_EQ(Nearest(quantizer, rows, kWanted, 3), one);
  for (const std::uint32_t row : {0U, 70U, 149U}) {
    const auto alone = Nearest(quantizer, SelectRows(rows, std::vector{row}), kWanted);
    EXPECT_TRUE(std::equal(alone.begin(), alone.end(), one.begin() + row * kWanted));
  }
  const auto nearest = quantizer.Assign(rows, 2);
  for (std::size_t i = 0; i < rows.rows; ++i) EXPECT_EQ(nearest[i], one[i * kWanted]);
}

TEST(WordGroups, MoreWordsThanTheNearestGroupsHave) {
  const Descriptors words = RandomFloats(WordGroups::kLeastWords, 4, 6);
  const Quantizer quantizer(MakeVocabulary(words));
  auto all = Nearest(quantizer, RandomFloats(2, 4, 7), static_cast<int>(words.rows));
  ASSERT_EQ(all.size(), 2 * words.rows);
  std::sort(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(words.rows));
  for (std::uint32_t w = 0; w < words.rows; ++w) ASSERT_EQ(all[w], w);
}

}  // namespace
}  // namespace pliant::testing
