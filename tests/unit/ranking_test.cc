// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ranking: ties, scores at their ends, threads. The scores' oracle is in inverted_index_test.
#include "index/rank/ranking.h"

#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "index/rank/inverted_index.h"
#include "tests/unit/index_test_words.h"

namespace pliant::testing {
namespace {

TEST(Ranking, EqualPicturesComeInOrderOfTheirIds) {
  InvertedIndex index(300);
  std::vector<IndexedPicture> pictures;
  for (std::int64_t key = 1; key <= 200; ++key) {
    pictures.push_back(Picture(key, {{0, 3}, {7, 300}, {9, 1}}));
    pictures.back().id = "id" + std::to_string(1000 + (key * 37) % 200);
  }
  // One by one and all at once: other segments, dense and sparse lists, same scores to the last
  // bit.
  InvertedIndex one_by_one(300);
  for (const IndexedPicture& picture : pictures) one_by_one.Apply({picture}, {});
  index.Apply(pictures, {});
  for (const RankMethod method : {RankMethod::kTfIdf, RankMethod::kHistogram}) {
    for (const InvertedIndex* each : {&index, &one_by_one}) {
      const Ranking ranking = Rank(*each->snapshot(), {{{0, 1}, {7, 5}, {200, 2}}, 8, {}, {}},
                                   {method, GroupBy::kImage, 50, 0, {}, 1});
      ASSERT_EQ(ranking.best.size(), 50u);
      for (std::size_t i = 0; i < 50; ++i) {
        EXPECT_EQ(ranking.best[i].ref.id, "id" + std::to_string(1000 + i));
        EXPECT_EQ(ranking.best[i].score, ranking.best[0].score);
      }
    }
  }
}

TEST(Ranking, ItselfIsOneAndAStrangerIsNoHit) {
  InvertedIndex index(100);
  const IndexedPicture a = Picture(1, {{0, 3}, {7, 4000}, {9, 1}});
  const IndexedPicture b = Picture(2, {{50, 3}});
  index.Apply({a, b}, {});
  for (const RankMethod method : {RankMethod::kTfIdf, RankMethod::kHistogram}) {
    const Ranking ranking = Rank(*index.snapshot(), a.bow, {method, GroupBy::kImage, 0, 0, {}, 1});
    ASSERT_FALSE(ranking.best.empty());
    EXPECT_EQ(ranking.best[0].ref.version, 1);
    EXPECT_NEAR(ranking.best[0].score, 1, 1e-6);
    EXPECT_EQ(ranking.best.size(), method == RankMethod::kTfIdf ? 1u : 2u);
  }
  const Ranking strict =
      Rank(*index.snapshot(), a.bow, {RankMethod::kHistogram, GroupBy::kImage, 0, 0.5, {}, 1});
  EXPECT_EQ(strict.total, 1u);
}

TEST(Ranking, ASinglePictureAnswers) {
  InvertedIndex index(10);
  index.Apply({Picture(1, {{3, 2}})}, {});
  const Ranking ranking = Rank(*index.snapshot(), {{{3, 1}}, 1, {}, {}}, {});
  ASSERT_EQ(ranking.best.size(), 1u);
  EXPECT_NEAR(ranking.best[0].score, 1, 1e-6);
}

TEST(Ranking, ThreadsChangeNothing) {
  std::mt19937_64 random(8);
  InvertedIndex index(400);
  std::vector<IndexedPicture> pictures;
  for (std::int64_t key = 1; key <= 12000; ++key) {
    pictures.push_back({key, static_cast<std::int64_t>(random() % 500), "id" + std::to_string(key),
                        ToBow(RandomCounts(random, 400, 60))});
    if (pictures.size() == 3000) index.Apply(std::exchange(pictures, {}), {});
  }
  const Bow query = ToBow(RandomCounts(random, 400, 400));
  for (const RankMethod method : {RankMethod::kTfIdf, RankMethod::kHistogram}) {
    const Ranking one = Rank(*index.snapshot(), query, {method, GroupBy::kObject, 100, 0, {}, 1});
    const Ranking four = Rank(*index.snapshot(), query, {method, GroupBy::kObject, 100, 0, {}, 4});
    ASSERT_EQ(one.best.size(), four.best.size());
    EXPECT_EQ(one.total, four.total);
    for (std::size_t i = 0; i < one.best.size(); ++i) {
      EXPECT_EQ(one.best[i].ref.version, four.best[i].ref.version);
      EXPECT_EQ(one.best[i].score, four.best[i].score);
    }
  }
}

}  // namespace
}  // namespace pliant::testing
