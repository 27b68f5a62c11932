// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ranking: ties, scores at their ends, threads. The scores' oracle is in inverted_index_test.
#include "index/rank/ranking.h"

#include <algorithm>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "index/rank/inverted_index.h"
#include "tests/unit/index_test_words.h"

namespace pliant::testing {
namespace {

RankOptions Best(std::size_t keep, GroupBy group_by = GroupBy::kImage) {
  RankOptions options;
  options.group_by = group_by;
  options.keep = keep;
  return options;
}

TEST(Ranking, EqualImagesComeInOrderOfTheirIds) {
  InvertedIndex index(ByteQuantizer(300));
  std::vector<IndexedImage> images;
  for (std::int64_t key = 1; key <= 200; ++key) {
    images.push_back(MakeImage(key, {{0, 3}, {7, 300}, {9, 1}}));
    images.back().id = "id" + std::to_string(1000 + (key * 37) % 200);
  }
  // One by one and all at once: other segments, same scores to the last bit.
  InvertedIndex one_by_one(ByteQuantizer(300));
  for (const IndexedImage& image : images) one_by_one.Apply({image}, {});
  index.Apply(images, {});
  for (const InvertedIndex* each : {&index, &one_by_one}) {
    const Ranking ranking =
        RankByHistogram(*each->snapshot(), Counted({{0, 1}, {7, 5}, {200, 2}}), Best(50));
    ASSERT_EQ(ranking.best.size(), 50u);
    for (std::size_t i = 0; i < 50; ++i) {
      EXPECT_EQ(ranking.best[i].ref.id, "id" + std::to_string(1000 + i));
      EXPECT_EQ(ranking.best[i].score, ranking.best[0].score);
    }
  }
}

TEST(Ranking, ItselfIsOneAndEveryImageIsAHit) {
  InvertedIndex index(ByteQuantizer(100));
  const IndexedImage a = MakeImage(1, {{0, 3}, {7, 4000}, {9, 1}});
  index.Apply({a, MakeImage(2, {{50, 3}})}, {});
  const Ranking ranking = RankByHistogram(*index.snapshot(), a.bow, Best(0));
  ASSERT_EQ(ranking.best.size(), 2u);
  EXPECT_EQ(ranking.best[0].ref.version, 1);
  EXPECT_NEAR(ranking.best[0].score, 1, 1e-6);
  RankOptions strict = Best(0);
  strict.min_score = 0.5;
  EXPECT_EQ(RankByHistogram(*index.snapshot(), a.bow, strict).total, 1u);
}

TEST(Ranking, ASingleImageAnswers) {
  InvertedIndex index(ByteQuantizer(10));
  index.Apply({MakeImage(1, {{3, 2}})}, {});
  const Ranking ranking = RankByHistogram(*index.snapshot(), Counted({{3, 1}}), Best(0));
  ASSERT_EQ(ranking.best.size(), 1u);
  EXPECT_NEAR(ranking.best[0].score, 1, 1e-6);
}

TEST(Ranking, ThreadsChangeNothing) {
  std::mt19937_64 random(8);
  InvertedIndex index(ByteQuantizer(400));
  std::vector<IndexedImage> images;
  for (std::int64_t key = 1; key <= 12000; ++key) {
    images.push_back({key, static_cast<std::int64_t>(random() % 500), "id" + std::to_string(key),
                      ToBow(RandomCounts(random, 400, 60))});
    if (images.size() == 3000) index.Apply(std::exchange(images, {}), {});
  }
  const Bow query = ToBow(RandomCounts(random, 400, 400));
  RankOptions options = Best(100, GroupBy::kObject);
  const Ranking one = RankByHistogram(*index.snapshot(), query, options);
  options.threads = 4;
  const Ranking four = RankByHistogram(*index.snapshot(), query, options);
  ASSERT_EQ(one.best.size(), four.best.size());
  EXPECT_EQ(one.total, four.total);
  for (std::size_t i = 0; i < one.best.size(); ++i) {
    EXPECT_EQ(one.best[i].ref.version, four.best[i].ref.version);
    EXPECT_EQ(one.best[i].score, four.best[i].score);
  }
}

TEST(Ranking, CandidatesAndTheRestAreThePlainRankingInTwo) {
  std::mt19937_64 random(9);
  InvertedIndex index(ByteQuantizer(150));
  for (std::int64_t key = 1; key <= 250; ++key) {
    index.Apply({{key, static_cast<std::int64_t>(random() % 9), "id" + std::to_string(key),
                  ToBow(RandomCounts(random, 150, 1 + random() % 120))}},
                {});
  }
  const auto snapshot = index.snapshot();
  const Bow query = ToBow(RandomCounts(random, 150, 100));
  const std::vector<RankedImage> all = RankByHistogram(*snapshot, query, Best(0)).best;
  ASSERT_EQ(all.size(), 250U);
  for (const std::size_t depth : {1U, 17U, 100U, 10'000U}) {
    for (const GroupBy group_by : {GroupBy::kImage, GroupBy::kObject}) {
      for (const std::size_t keep : {0U, 3U}) {
        RankOptions options = Best(keep, group_by);
        options.candidates = [depth](std::size_t) { return depth; };
        options.min_score = all[all.size() * 3 / 4].score;
        const Ranking split = RankByHistogram(*snapshot, query, options);
        const std::size_t apart = std::min(depth, all.size());
        ASSERT_EQ(split.candidates.size(), apart);
        std::set<std::int64_t> shown;
        for (std::size_t i = 0; i < apart; ++i) {
          EXPECT_EQ(split.candidates[i].ref.version, all[i].ref.version);
          shown.insert(all[i].object);
        }
        std::vector<std::int64_t> rest;
        for (std::size_t i = apart; i < all.size(); ++i) {
          if (all[i].score < options.min_score) continue;
          if (group_by == GroupBy::kObject && all[i].object != 0 &&
              !shown.insert(all[i].object).second) {
            continue;
          }
          rest.push_back(all[i].ref.version);
        }
        EXPECT_EQ(split.total, rest.size());
        if (keep != 0 && keep < rest.size()) rest.resize(keep);
        ASSERT_EQ(split.best.size(), rest.size());
        for (std::size_t i = 0; i < rest.size(); ++i) EXPECT_EQ(split.best[i].ref.version, rest[i]);
      }
    }
  }
}

}  // namespace
}  // namespace pliant::testing
