// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ranking by signatures, and the split into candidates and other hits, against plain loops.
#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "index/rank/ranking.h"
#include "tests/unit/expect_error.h"

namespace pliant {
namespace {

using testing::ExpectError;

constexpr std::size_t kWords = 150;

// Low words are frequent, so that there are dense and sparse posting lists; counts above 255 too.
Bow RandomBow(std::mt19937_64& random, bool with_signatures = true) {
  std::map<std::uint32_t, std::uint32_t> counts;
  const std::size_t keypoints = 1 + random() % 120;
  for (std::size_t i = 0; i < keypoints; ++i) {
    const double u = static_cast<double>(random() >> 11) * 0x1.0p-53;
    counts[static_cast<std::uint32_t>(u * u * kWords)] += random() % 40 == 0 ? 400 : 1;
  }
  Bow bow;
  for (const auto& [word, count] : counts) {
    bow.words.push_back({word, count});
    bow.total += count;
    // Signatures of a word differ in few bits or in many.
    std::uint64_t signature = 0x0123456789abcdefULL * (word + 1);
    for (std::uint64_t flips = random() % 40; flips > 0; --flips) {
      signature ^= std::uint64_t{1} << random() % 64;
    }
    if (with_signatures) bow.signatures.push_back(signature);
  }
  return bow;
}

using Pictures = std::map<std::int64_t, IndexedPicture>;

double Idf(const Pictures& pictures, std::uint32_t word) {
  double df = 0;
  for (const auto& [key, picture] : pictures) {
    for (const WordCount& entry : picture.bow.words) df += entry.word == word ? 1 : 0;
  }
  return std::log((static_cast<double>(pictures.size()) + 1) / std::max(1.0, df));
}

double OracleScore(const Bow& query, const Bow& picture, const std::vector<double>& idf) {
  double sum = 0;
  double query_norm = 0;
  double picture_norm = 0;
  for (const WordCount& entry : picture.words) picture_norm += idf[entry.word];
  for (std::size_t i = 0; i < query.words.size(); ++i) {
    const std::uint32_t word = query.words[i].word;
    query_norm += idf[word];
    for (std::size_t j = 0; j < picture.words.size(); ++j) {
      if (picture.words[j].word != word) continue;
      const double alike = 1 - std::popcount(query.signatures[i] ^ picture.signatures[j]) / 32.0;
      if (alike > 0) sum += idf[word] * std::pow(alike, 5);
    }
  }
  return sum / std::sqrt(query_norm * picture_norm);
}

class SignedRanking : public ::testing::TestWithParam<std::uint64_t> {
 protected:
  void Fill(int pictures) {
    for (int step = 0; pictures > 0; ++step) {
      std::vector<IndexedPicture> added;
      for (std::uint64_t i = 1 + random_() % 90; i > 0 && pictures > 0; --i, --pictures) {
        IndexedPicture picture{next_, static_cast<std::int64_t>(random_() % 9),
                               "p" + std::to_string(random_() % 1000) + "-" + std::to_string(next_),
                               RandomBow(random_)};
        added.push_back(picture);
        pictures_[next_++] = picture;
      }
      std::vector<std::int64_t> removed;
      if (step > 0) {
        for (int i = 0; i < 5; ++i) {
          const auto victim = std::next(
              pictures_.begin(), static_cast<std::ptrdiff_t>(random_() % pictures_.size() / 2));
          if (victim->first >= added.front().key) continue;
          removed.push_back(victim->first);
          pictures_.erase(victim);
        }
      }
      index_.Apply(std::move(added), removed);
    }
    index_.Refresh();
    for (std::uint32_t w = 0; w < kWords; ++w) idf_.push_back(Idf(pictures_, w));
  }

  std::mt19937_64 random_{GetParam()};
  std::int64_t next_ = 1;
  InvertedIndex index_{kWords};
  Pictures pictures_;
  std::vector<double> idf_;
};

TEST_P(SignedRanking, ScoresAreThoseOfTheFormula) {
  Fill(400);
  const auto snapshot = index_.snapshot();
  ASSERT_TRUE(snapshot->has_signatures());
  for (int round = 0; round < 5; ++round) {
    const Bow query = RandomBow(random_);
    RankOptions options;
    options.threads = 1 + round % 3;
    const Ranking ranking = Rank(*snapshot, query, options);
    std::map<std::int64_t, double> found;
    for (std::size_t i = 0; i < ranking.best.size(); ++i) {
      found[ranking.best[i].ref.version] = ranking.best[i].score;
      if (i > 0) {
        EXPECT_GE(ranking.best[i - 1].score, ranking.best[i].score);
      }
    }
    for (const auto& [key, picture] : pictures_) {
      const double expected = OracleScore(query, picture.bow, idf_);
      ASSERT_NEAR(found.contains(key) ? found[key] : 0.0, expected, 2e-6);
      EXPECT_EQ(found.contains(key), expected > 0);
    }
  }
}

TEST_P(SignedRanking, WordsAndSignaturesComeBack) {
  Fill(200);
  for (const auto& [key, picture] : pictures_) {
    const auto bow = index_.snapshot()->Find(key);
    ASSERT_TRUE(bow);
    EXPECT_EQ(bow->words, picture.bow.words);
    EXPECT_EQ(bow->signatures, picture.bow.signatures);
  }
}

TEST_P(SignedRanking, ItselfIsOneAndWithoutSignaturesTheScoreIsThatOfTfIdf) {
  Fill(150);
  const auto snapshot = index_.snapshot();
  for (const auto& [key, picture] : pictures_) {
    RankOptions options;
    options.keep = 1;
    const Ranking own = Rank(*snapshot, picture.bow, options);
    EXPECT_EQ(own.best.at(0).ref.version, key);
    EXPECT_NEAR(own.best.at(0).score, 1, 1e-5);
  }
  Bow unsigned_query = RandomBow(random_);
  RankOptions options;
  options.signatures = false;
  const Ranking told = Rank(*snapshot, unsigned_query, options);
  unsigned_query.signatures.clear();
  options.signatures = true;
  const Ranking bare = Rank(*snapshot, unsigned_query, options);
  ASSERT_EQ(told.best.size(), bare.best.size());
  for (std::size_t i = 0; i < told.best.size(); ++i) {
    EXPECT_EQ(told.best[i].ref.version, bare.best[i].ref.version);
    EXPECT_EQ(told.best[i].score, bare.best[i].score);
  }
}

TEST_P(SignedRanking, CandidatesAndTheRestAreThePlainRankingInTwo) {
  Fill(250);
  const auto snapshot = index_.snapshot();
  const Bow query = RandomBow(random_);
  const std::vector<RankedPicture> all = Rank(*snapshot, query, {}).best;
  ASSERT_GT(all.size(), 100U);
  for (const std::size_t depth : {1U, 17U, 100U, 10'000U}) {
    for (const GroupBy group_by : {GroupBy::kImage, GroupBy::kObject}) {
      for (const std::size_t keep : {0U, 3U}) {
        RankOptions options;
        options.group_by = group_by;
        options.candidates = depth;
        options.keep = keep;
        options.min_score = all[all.size() * 3 / 4].score;
        const Ranking split = Rank(*snapshot, query, options);
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

INSTANTIATE_TEST_SUITE_P(Seeds, SignedRanking, ::testing::Values(1, 2));

TEST(SignedRankingErrors, AMixtureIsRefused) {
  std::mt19937_64 random(3);
  std::vector<IndexedPicture> pictures = {{1, 0, "a", RandomBow(random)},
                                          {2, 0, "b", RandomBow(random, false)}};
  InvertedIndex index(kWords);
  ExpectError(ErrorCode::kCorrupt, "signatures_missing", [&] { index.Apply(pictures, {}); });
}

}  // namespace
}  // namespace pliant
