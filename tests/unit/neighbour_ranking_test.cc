// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ranking by nearest neighbours against a brute-force oracle, while images come and go.
#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <map>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/match/distance.h"
#include "index/rank/ranking.h"
#include "tests/unit/random_descriptors.h"
#include "vocab/residual_codes.h"

namespace pliant {
namespace {

using testing::Coded;

constexpr int kDim = 32;
constexpr std::size_t kWords = 24;
constexpr double kReach = 0.7;  // NeighbourOptions
constexpr double kLeast = 0.3;
constexpr std::size_t kCells = 16;

Descriptors RandomUnit(std::mt19937_64& random, std::size_t rows) {
  std::normal_distribution<float> normal;
  Descriptors result = Descriptors::Float(rows, kDim);
  for (std::size_t i = 0; i < rows; ++i) {
    double squared = 0;
    for (int d = 0; d < kDim; ++d) {
      float& x = result.floats[i * kDim + d];
      x = normal(random);
      squared += static_cast<double>(x) * x;
    }
    for (int d = 0; d < kDim; ++d) {
      result.floats[i * kDim + d] /= static_cast<float>(std::sqrt(squared));
    }
  }
  return result;
}

Descriptors RandomBits(std::mt19937_64& random, std::size_t rows) {
  Descriptors result = Descriptors::Binary(rows, kDim);
  for (std::uint8_t& byte : result.bytes) byte = static_cast<std::uint8_t>(random());
  return result;
}

// Rows of `base` with some noise, so that there are neighbours.
Descriptors Near(std::mt19937_64& random, const Descriptors& base, double noise) {
  Descriptors result = base;
  std::normal_distribution<float> normal(0, static_cast<float>(noise));
  for (float& x : result.floats) x += normal(random);
  for (std::uint8_t& byte : result.bytes) {
    if (random() % 8 == 0) byte ^= static_cast<std::uint8_t>(1U << (random() % 8));
  }
  return result;
}

struct Stored {
  Descriptors descriptors;
  std::vector<std::uint32_t> words;
  std::int64_t object = 0;
};

class NeighbourRankingTest : public ::testing::TestWithParam<bool> {
 protected:
  NeighbourRankingTest() {
    const Descriptors samples = Random(600);
    auto vocabulary = std::make_shared<Vocabulary>();
    KMedoidsOptions options;
    options.k = kWords;
    *vocabulary = TrainVocabulary(samples, "test", samples.rows, options);
    quantizer_ = std::make_shared<const Quantizer>(std::move(vocabulary));
    index_ = std::make_unique<InvertedIndex>(quantizer_);
  }
  Descriptors Random(std::size_t rows) {
    return GetParam() ? RandomBits(random_, rows) : RandomUnit(random_, rows);
  }

  IndexedImage Make(std::int64_t key, Descriptors descriptors, std::int64_t object) {
    Stored& stored = truth_[key];
    stored.words = quantizer_->Assign(descriptors);
    stored.descriptors = std::move(descriptors);
    stored.object = object;
    return {key, object, "id" + std::to_string(key),
            quantizer_->BowOf(Coded(stored.descriptors).view(), stored.words)};
  }

  // The distance from its code, by the formula in vocab/residual_codes.h.
  double Estimated(const Descriptors& query, std::size_t q, double base, const Stored& stored,
                   std::size_t x) const {
    const ResidualCoder& coder = *quantizer_->coder();
    const std::vector<std::uint32_t> row{static_cast<std::uint32_t>(x)};
    const auto [code, biases] =
        coder.Encode(Coded(stored.descriptors).view(), row, {&stored.words[x], 1});
    if (coder.binary()) {
      double bits = 0;
      for (int d = 0; d < kDim; ++d)
        bits += std::popcount(static_cast<unsigned>(code[d] ^ query.binary_row(q)[d]));
      return bits;
    }
    const LookupTable table = coder.TableOf(query.float_row(q));
    double sum = 0;
    for (std::size_t p = 0; p < 2 * code.size(); ++p) {
      const std::size_t nibble = p % 2 == 0 ? code[p / 2] & 15 : code[p / 2] >> 4;
      sum += table.entries[p * 16 + nibble];
    }
    const double distance = base + table.offset + table.step * sum +
                            static_cast<double>(coder.bias_step()) * biases.at(0);
    return std::max(0.0, distance);
  }

  // `weights`: by row of the query; empty: 1 each.
  std::map<std::int64_t, double> OracleScores(const Descriptors& query,
                                              std::span<const float> weights) const {
    struct Best {
      double vote = 0;
      std::size_t x = 0;
    };
    std::map<std::int64_t, std::map<std::size_t, std::vector<double>>> votes;  // image, x
    double most = 0;
    double voices = 0;
    const auto cells = quantizer_->NearestWords(query, kCells);
    for (std::size_t q = 0; q < query.rows; ++q) {
      const auto square = [&](float d) {
        return quantizer_->coder()->binary() ? d : static_cast<double>(d) * d;
      };
      const double limit =
          kReach * std::max<double>(square(cells[q * kCells].distance),
                                    kLeast * square(cells[q * kCells + kCells - 1].distance));
      const double weight = weights.empty() ? 1 : weights[q];
      most += weight * limit;
      voices += weight;
      std::map<std::int64_t, Best> best;
      for (const auto& [key, stored] : truth_) {
        for (std::size_t x = 0; x < stored.words.size(); ++x) {
          for (std::size_t c = 0; c < kCells; ++c) {
            const NearWord& cell = cells[q * kCells + c];
            if (cell.word != stored.words[x]) continue;
            const double vote = limit - Estimated(query, q, square(cell.distance), stored, x);
            if (vote > 1e-6 && vote > best[key].vote) best[key] = {vote, x};
          }
        }
      }
      std::erase_if(best, [](const auto& entry) { return entry.second.vote == 0; });
      for (const auto& [key, vote] : best) {
        votes[key][vote.x].push_back(weight * vote.vote /
                                     std::sqrt(static_cast<double>(best.size())));
      }
    }
    std::map<std::int64_t, double> scores;
    const double root = std::sqrt(std::max(8.0, voices));
    for (auto& [key, of_image] : votes) {
      double sum = 0;
      for (auto& [x, of_code] : of_image) {
        std::sort(of_code.rbegin(), of_code.rend());
        for (std::size_t i = 0; i < of_code.size(); ++i)
          sum += of_code[i] / static_cast<double>(i + 1);
      }
      const auto rows = static_cast<double>(truth_.at(key).words.size());
      scores[key] = std::min(1.0, sum * root / (std::sqrt(std::max(8.0, rows)) * most));
    }
    return scores;
  }

  RankQuery QueryOf(const Descriptors& descriptors, std::span<const float> weights = {}) const {
    return NeighboursOf(descriptors, {weights.begin(), weights.end()}, *quantizer_, 1);
  }
  Ranking Ranked(const Descriptors& descriptors, std::span<const float> weights = {},
                 const RankOptions& options = {}) const {
    return Rank(*index_->snapshot(), *quantizer_, QueryOf(descriptors, weights), options);
  }

  void ExpectOraclesRanking(const Descriptors& query, const RankOptions& options,
                            std::span<const float> weights = {}) const {
    const Ranking ranking = Ranked(query, weights, options);
    std::map<std::int64_t, double> expected = OracleScores(query, weights);
    std::erase_if(expected, [&](const auto& entry) {
      return !options.admission.Admits(entry.first, truth_.at(entry.first).object);
    });
    // A vote near 0 may fall on either side by rounding.
    EXPECT_NEAR(static_cast<double>(ranking.total), static_cast<double>(expected.size()), 1);
    for (std::size_t i = 0; i < ranking.best.size(); ++i) {
      const RankedImage& hit = ranking.best[i];
      EXPECT_NEAR(hit.score, expected[hit.ref.version], 1e-4) << "image " << hit.ref.version;
      EXPECT_TRUE(i == 0 || ranking.best[i - 1].score >= hit.score);
    }
  }

  std::mt19937_64 random_{11};
  std::shared_ptr<const Quantizer> quantizer_;
  std::unique_ptr<InvertedIndex> index_;
  std::map<std::int64_t, Stored> truth_;
};
INSTANTIATE_TEST_SUITE_P(Kinds, NeighbourRankingTest, ::testing::Bool(),
                         [](const auto& kind) { return kind.param ? "Binary" : "Floats"; });

TEST_P(NeighbourRankingTest, AgreesWithTheOracleWhileImagesComeAndGo) {
  const Descriptors query = Random(40);
  std::int64_t next = 1;
  for (int step = 0; step < 30; ++step) {
    std::vector<IndexedImage> added;
    for (std::uint64_t i = 0; i < 1 + random_() % 4; ++i) {
      const bool is_near = random_() % 3 == 0;
      Descriptors own = is_near ? Near(random_, query, 0.1) : Random(5 + random_() % 60);
      added.push_back(Make(next, std::move(own), static_cast<std::int64_t>(random_() % 3)));
      ++next;
    }
    std::vector<std::int64_t> removed;
    if (truth_.size() > 6) {
      const auto gone = std::next(truth_.begin(), static_cast<std::ptrdiff_t>(random_() % 4));
      removed.push_back(gone->first);
      truth_.erase(gone);
    }
    std::erase_if(added, [&](const IndexedImage& p) { return !truth_.contains(p.key); });
    index_->Apply(std::move(added), removed);
    RankOptions options;
    options.threads = 1 + step % 2;
    ExpectOraclesRanking(query, options);
    options.admission.object_key = 1;
    ExpectOraclesRanking(query, options);
  }
}

TEST_P(NeighbourRankingTest, VotesCountWhatTheirWeightsSay) {
  const Descriptors query = Random(40);
  for (std::int64_t key = 1; key <= 12; ++key) {
    Descriptors own = key % 2 == 0 ? Near(random_, query, 0.1) : Random(30);
    index_->Apply({Make(key, std::move(own), 0)}, {});
  }
  std::vector<float> weights;
  for (std::size_t i = 0; i < query.rows; ++i) {
    weights.push_back(static_cast<float>(1 + random_() % 100) / 100);
  }
  ExpectOraclesRanking(query, {}, weights);
  ExpectOraclesRanking(query, {}, std::vector<float>(query.rows, 1.0F));
  // All of half the weight are as good as half as many descriptors.
  const auto scores = [&](float weight) {
    const std::vector<float> equal(query.rows, weight);
    std::map<std::int64_t, double> all;
    const RankOptions options;
    for (const RankedImage& hit : Ranked(query, equal, options).best) {
      all[hit.ref.version] = hit.score;
    }
    return all;
  };
  const auto whole = scores(1);
  for (const auto& [key, score] : scores(0.5F)) {
    EXPECT_NEAR(score, std::min(1.0, whole.at(key) / std::sqrt(2)), 1e-5) << "image " << key;
  }
}

TEST_P(NeighbourRankingTest, PartsRankAsTheWholeBitByBit) {
  constexpr std::size_t kParts = 3;
  std::deque<InvertedIndex> parts;
  for (std::size_t i = 0; i < kParts; ++i) parts.emplace_back(quantizer_);
  const Descriptors asked = Random(40);
  for (std::int64_t key = 1; key <= 90; ++key) {
    Descriptors own = random_() % 3 == 0 ? Near(random_, asked, 0.1) : Random(5 + random_() % 40);
    const IndexedImage image = Make(key, std::move(own), static_cast<std::int64_t>(random_() % 9));
    index_->Apply({image}, {});
    parts[random_() % kParts].Apply({image}, {});
  }
  const RankQuery query = QueryOf(asked);
  for (int round = 0; round < 40; ++round) {
    RankOptions options;
    options.group_by = random_() % 2 == 0 ? GroupBy::kImage : GroupBy::kObject;
    options.keep = random_() % 8;
    options.min_score = random_() % 2 == 0 ? 0 : 0.05;
    const std::size_t depth = random_() % 3 == 0 ? 0 : random_() % 40;
    options.candidates = [depth](std::size_t) { return depth; };
    std::vector<std::unique_ptr<PartRanker>> rankers;
    std::vector<std::shared_ptr<const IndexSnapshot>> snapshots;
    std::vector<std::uint32_t> voted(asked.rows);
    for (const InvertedIndex& part : parts) {
      snapshots.push_back(part.snapshot());
      rankers.push_back(std::make_unique<PartRanker>(*snapshots.back(), *quantizer_, query, 1));
      const auto& own = rankers.back()->voted();
      std::transform(own.begin(), own.end(), voted.begin(), voted.begin(), std::plus<>());
    }
    std::vector<PartRanking> rankings;
    for (const auto& ranker : rankers) {
      rankings.push_back(ranker->Rank(voted, depth, options));
      std::ranges::sort(rankings.back().objects);
    }
    const Ranking merged = Merge(std::move(rankings), depth, options);
    const Ranking whole = Rank(*index_->snapshot(), *quantizer_, query, options);
    EXPECT_EQ(merged.total, whole.total);
    const auto expect_same = [](const auto& a, const auto& b) {
      ASSERT_EQ(a.size(), b.size());
      for (std::size_t i = 0; i < a.size(); ++i) {
        EXPECT_EQ(a[i].ref.version, b[i].ref.version);
        EXPECT_EQ(a[i].score, b[i].score);
      }
    };
    expect_same(merged.candidates, whole.candidates);
    expect_same(merged.best, whole.best);
  }
}

TEST_P(NeighbourRankingTest, ACopyIsFirstAndScoresNearOne) {
  for (std::int64_t key = 1; key <= 20; ++key) {
    index_->Apply({Make(key, Random(50), 0)}, {});
  }
  const Stored& copied = truth_.at(7);
  const Ranking ranking = Ranked(copied.descriptors);
  ASSERT_FALSE(ranking.best.empty());
  EXPECT_EQ(ranking.best[0].ref.version, 7);
  EXPECT_GT(ranking.best[0].score, 0.5);
  EXPECT_LE(ranking.best[0].score, 1);
}

// One that is stored several times, or the first of a small collection, makes up the vocabulary:
// its descriptors are at no distance from their words.
TEST_P(NeighbourRankingTest, AnImageOfWordsIsFound) {
  for (std::int64_t key = 1; key <= 5; ++key) index_->Apply({Make(key, Random(50), 0)}, {});
  const Descriptors words = quantizer_->vocabulary().words;
  index_->Apply({Make(6, words, 0), Make(7, words, 0)}, {});
  const Ranking ranking = Ranked(words);
  ASSERT_GE(ranking.best.size(), 2U);
  EXPECT_THAT((std::vector{ranking.best[0].ref.version, ranking.best[1].ref.version}),
              ::testing::UnorderedElementsAre(6, 7));
  EXPECT_GT(ranking.best[1].score, 0.3);
}

TEST_P(NeighbourRankingTest, AQueryWithoutDescriptorsFindsNothing) {
  index_->Apply({Make(1, Random(50), 0)}, {});
  EXPECT_EQ(Ranked(Random(0)).total, 0U);
}

TEST_P(NeighbourRankingTest, ImagesWithoutCodesAreRefused) {
  IndexedImage image = Make(1, Random(10), 0);
  image.bow.codes.pop_back();
  EXPECT_ANY_THROW(index_->Apply({image}, {}));
}

}  // namespace
}  // namespace pliant
