// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The inverted index against a brute-force oracle that holds plain vectors.
#include "index/rank/inverted_index.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "index/rank/ranking.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_words.h"

namespace pliant::testing {
namespace {

// Of the living images, ascending.
std::vector<std::int64_t> KeysOf(const IndexSnapshot& snapshot) {
  std::vector<std::int64_t> keys;
  for (const IndexSnapshot::Part& part : snapshot.parts) {
    for (std::size_t p = 0; p < part.segment->size(); ++p) {
      if (!part.IsDead(p)) keys.push_back((*part.segment)[p].key);
    }
  }
  std::sort(keys.begin(), keys.end());
  return keys;
}

struct Truth {
  std::int64_t object = 0;
  std::string id;
  std::vector<double> counts;  // one a word
  double total = 0;
};

using Truths = std::map<std::int64_t, Truth>;

double Norm(const std::vector<double>& v) {
  double sum = 0;
  for (const double x : v) sum += x * x;
  return std::sqrt(sum);
}

double OracleScore(const std::vector<double>& query, const Truth& truth) {
  std::vector<double> difference = query;
  double total = 0;
  for (const double x : query) total += x;
  for (std::size_t w = 0; w < query.size(); ++w) {
    difference[w] = query[w] / total - truth.counts[w] / truth.total;
  }
  return 1 - Norm(difference) / std::numbers::sqrt2;
}

// Scores agree, nobody is missing, and the order is that of the scores with ties by id.
void ExpectRanking(const IndexSnapshot& snapshot, const Truths& truths,
                   const std::vector<double>& query, const RankOptions& options) {
  const Ranking ranking = RankByHistogram(snapshot, ToBow(query), options);
  std::map<std::string, double> expected;  // by "object" or "id"
  const auto name = [&](std::int64_t object, const std::string& id) {
    return options.group_by == GroupBy::kObject && object != 0 ? std::to_string(object)
                                                               : "id " + id;
  };
  for (const auto& [key, truth] : truths) {
    if (!options.admission.Admits(key, truth.object)) continue;
    const double score = OracleScore(query, truth);
    double& best = expected.try_emplace(name(truth.object, truth.id), -1.0).first->second;
    best = std::max(best, score);
  }
  ASSERT_EQ(ranking.total, expected.size());
  const std::size_t count =
      options.keep == 0 ? expected.size() : std::min(options.keep, expected.size());
  ASSERT_EQ(ranking.best.size(), count);
  std::vector<double> scores;
  for (const auto& [n, score] : expected) scores.push_back(score);
  std::sort(scores.rbegin(), scores.rend());
  std::set<std::string> seen;
  for (std::size_t i = 0; i < count; ++i) {
    const RankedImage& hit = ranking.best[i];
    ASSERT_TRUE(truths.contains(hit.ref.version));
    EXPECT_EQ(truths.at(hit.ref.version).id, hit.ref.id);
    EXPECT_EQ(truths.at(hit.ref.version).object, hit.object);
    const std::string hit_name = name(hit.object, hit.ref.id);
    EXPECT_TRUE(seen.insert(hit_name).second) << hit_name << " twice";
    EXPECT_NEAR(hit.score, expected.at(hit_name), 2e-6);
    EXPECT_NEAR(hit.score, scores[i], 2e-6) << "rank " << i;
    if (i > 0) {
      const RankedImage& before = ranking.best[i - 1];
      EXPECT_TRUE(before.score > hit.score ||
                  (before.score == hit.score && before.ref.id < hit.ref.id));
    }
  }
}

void ExpectAllRankings(const IndexSnapshot& snapshot, const Truths& truths, std::mt19937_64& random,
                       std::size_t words) {
  const std::vector<double> query = RandomCounts(random, words, 1 + random() % 300);
  for (const GroupBy group_by : {GroupBy::kImage, GroupBy::kObject}) {
    for (const std::size_t keep : {0, 1, 7}) {
      ExpectRanking(snapshot, truths, query,
                    {.group_by = group_by, .keep = static_cast<std::size_t>(keep)});
    }
  }
  Admission accept;
  accept.object_key = 3;
  ExpectRanking(snapshot, truths, query,
                {.group_by = GroupBy::kImage, .keep = 5, .admission = accept, .threads = 2});
}

class RandomChanges : public ::testing::TestWithParam<std::tuple<std::size_t, std::uint64_t>> {};
INSTANTIATE_TEST_SUITE_P(InvertedIndex, RandomChanges,
                         ::testing::Combine(::testing::Values(1, 10, 200, 3000),
                                            ::testing::Values(1, 2)));

TEST_P(RandomChanges, AgreeWithTheOracle) {
  const auto [words, seed] = GetParam();
  SCOPED_TRACE("words " + std::to_string(words) + ", seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  InvertedIndex index(ByteQuantizer(words));
  Truths truths;
  std::int64_t next_key = 1;
  for (int step = 0; step < 60; ++step) {
    std::vector<IndexedImage> added;
    std::vector<std::int64_t> removed;
    const std::size_t adds = step % 7 == 0 ? random() % 90 : random() % 4;
    for (std::size_t i = 0; i < adds; ++i) {
      const std::int64_t key = next_key++;
      Truth truth{static_cast<std::int64_t>(random() % 6), "p" + std::to_string(random() % 1000000),
                  RandomCounts(random, words, 1 + random() % 900), 0};
      truth.id += "-" + std::to_string(key);
      for (const double c : truth.counts) truth.total += c;
      added.push_back({key, truth.object, truth.id, ToBow(truth.counts)});
      truths[key] = truth;
    }
    const std::size_t removals =
        truths.empty() ? 0 : random() % (step % 11 == 10 ? truths.size() : 3);
    for (std::size_t i = 0; i < removals; ++i) {
      const auto victim =
          std::next(truths.begin(), static_cast<std::ptrdiff_t>(random() % truths.size()));
      if (victim->first >= next_key - static_cast<std::int64_t>(adds)) continue;  // not added yet
      removed.push_back(victim->first);
      truths.erase(victim);
    }
    removed.push_back(next_key + 1000);  // unknown: ignored
    index.Apply(std::move(added), removed);
    const auto snapshot = index.snapshot();
    ASSERT_EQ(snapshot->images, truths.size());
    if (step % 4 == 0) ExpectAllRankings(*snapshot, truths, random, words);
  }
  const auto snapshot = index.snapshot();
  std::vector<std::int64_t> keys;
  for (const auto& [key, truth] : truths) {
    keys.push_back(key);
    const std::optional<Bow> bow = snapshot->Find(key);
    ASSERT_TRUE(bow);
    EXPECT_EQ(bow->words, ToBow(truth.counts).words);
    EXPECT_EQ(bow->codes, ToBow(truth.counts).codes);
  }
  EXPECT_EQ(KeysOf(*snapshot), keys);
  ExpectAllRankings(*snapshot, truths, random, words);
}

TEST(InvertedIndex, ASnapshotStaysAsItWas) {
  InvertedIndex index(ByteQuantizer(4));
  index.Apply({MakeImage(1, {{0, 2}})}, {});
  const auto before = index.snapshot();
  const std::vector<std::int64_t> removed = {1};
  index.Apply({MakeImage(2, {{1, 2}})}, removed);
  EXPECT_EQ(KeysOf(*before), std::vector<std::int64_t>{1});
  EXPECT_EQ(KeysOf(*index.snapshot()), std::vector<std::int64_t>{2});
  EXPECT_TRUE(before->Find(1));
  EXPECT_FALSE(index.snapshot()->Find(1));
}

TEST(InvertedIndex, ThePartsStayFewAndAddingOneDoesNotCopyTheRest) {
  InvertedIndex index(ByteQuantizer(50));
  std::mt19937_64 random(3);
  const IndexSegment* largest = nullptr;
  int rebuilt = 0;
  for (std::int64_t key = 1; key <= 3000; ++key) {
    index.Apply({MakeImage(key, {{static_cast<std::uint32_t>(random() % 50), 1}})}, {});
    const auto snapshot = index.snapshot();
    ASSERT_LE(snapshot->parts.size(), 40u);
    const auto& biggest = *std::max_element(
        snapshot->parts.begin(), snapshot->parts.end(),
        [](const auto& a, const auto& b) { return a.segment->size() < b.segment->size(); });
    if (key > 600 && biggest.segment.get() != largest) ++rebuilt;
    largest = biggest.segment.get();
  }
  EXPECT_LT(rebuilt, 12);
  EXPECT_EQ(index.snapshot()->images, 3000u);
}

TEST(InvertedIndex, RemovedImagesGiveTheirMemoryBack) {
  InvertedIndex index(ByteQuantizer(1000));
  std::mt19937_64 random(4);
  std::vector<IndexedImage> images;
  std::vector<std::int64_t> removed;
  for (std::int64_t key = 1; key <= 2000; ++key) {
    images.push_back({key, 0, "id" + std::to_string(key), ToBow(RandomCounts(random, 1000, 300))});
    if (key > 20) removed.push_back(key);
  }
  index.Apply(std::move(images), {});
  const std::size_t full = index.snapshot()->memory_bytes();
  index.Apply({}, removed);
  EXPECT_LT(index.snapshot()->memory_bytes(), full / 10);
  EXPECT_EQ(index.snapshot()->images, 20u);
}

TEST(InvertedIndex, EachDescriptorNeedsItsCode) {
  InvertedIndex index(ByteQuantizer(10));
  IndexedImage image = MakeImage(1, {{3, 2}});
  image.bow.codes.pop_back();
  ExpectError(ErrorCode::kCorrupt, "codes_missing", [&] { index.Apply({image}, {}); });
  ExpectError(ErrorCode::kInternal, "word_out_of_range",
              [&] { index.Apply({MakeImage(1, {{10, 1}})}, {}); });
  auto bare = std::make_shared<Vocabulary>(ByteQuantizer(10)->vocabulary());
  bare->codebook = {};
  ExpectError(ErrorCode::kInvalidArgument, "codebook_malformed",
              [&] { InvertedIndex(std::make_shared<const Quantizer>(bare)); });
}

}  // namespace
}  // namespace pliant::testing
