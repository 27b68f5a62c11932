// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/ranking.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>
#include <unordered_map>

#include "descriptor/parallel.h"

namespace pliant {
namespace {

using Part = IndexSnapshot::Part;

// Fewer posting-list steps than this are not worth a second thread.
constexpr std::size_t kStepsForThreads = 1u << 20;

struct Candidate {
  const IndexSegment* segment = nullptr;
  std::uint32_t picture = 0;
  double score = 0;
};

// The order of results: a total one, so that they do not depend on segments and threads.
bool IsBetter(const Candidate& a, const Candidate& b) {
  if (a.score != b.score) return a.score > b.score;
  return a.segment->id(a.picture) < b.segment->id(b.picture);
}

struct QueryWeights {
  std::vector<std::uint32_t> words;
  std::vector<float> weights;
  double total = 0;
  double norm = 0;     // |q| of tf-idf, with counts for tf
  double squares = 0;  // sum of squared counts
};

QueryWeights WeighQuery(const IndexSnapshot& snapshot, const Bow& query, RankMethod method) {
  QueryWeights result;
  for (const WordCount& entry : query.words) {
    if (entry.word >= snapshot.vocabulary_size) continue;
    const double idf = snapshot.statistics->idf[entry.word];
    const double count = entry.count;
    result.total += count;
    result.squares += count * count;
    result.norm += count * idf * count * idf;
    result.words.push_back(entry.word);
    // Histogram sums stay whole numbers, exact in float up to 4096 key points a picture.
    result.weights.push_back(
        static_cast<float>(method == RankMethod::kTfIdf ? count * idf * idf : count));
  }
  result.norm = std::sqrt(result.norm);
  return result;
}

double HistogramScore(const QueryWeights& query, const IndexSegment& segment, std::size_t picture,
                      double dot) {
  const double total = segment.total(picture);
  if (query.total == 0 || total == 0) return 0;
  const double squared_distance = query.squares / (query.total * query.total) +
                                  segment.sum_of_squares(picture) / (total * total) -
                                  2 * dot / (query.total * total);
  return std::max(0.0, 1 - std::sqrt(std::max(0.0, squared_distance)) / std::numbers::sqrt2);
}

void ScorePart(const Part& part, const QueryWeights& query, const RankOptions& options,
               std::vector<float>& sums, std::vector<Candidate>& candidates) {
  const IndexSegment& segment = *part.segment;
  sums.assign(segment.size(), 0.0F);
  for (std::size_t i = 0; i < query.words.size(); ++i) {
    segment.Accumulate(query.words[i], query.weights[i], sums.data());
  }
  const bool tf_idf = options.method == RankMethod::kTfIdf;
  for (std::uint32_t p = 0; p < segment.size(); ++p) {
    if ((tf_idf && sums[p] <= 0) || part.IsDead(p)) continue;
    if (options.accept && !options.accept(segment.key(p), segment.object(p))) continue;
    const double score =
        tf_idf ? std::min(1.0, static_cast<double>(sums[p]) * (*part.inverse_norms)[p] / query.norm)
               : HistogramScore(query, segment, p, sums[p]);
    if (score >= options.min_score) candidates.push_back({&segment, p, score});
  }
}

int ThreadsFor(const IndexSnapshot& snapshot, const QueryWeights& query, int threads) {
  return query.words.size() * snapshot.pictures < kStepsForThreads ? 1 : threads;
}

std::vector<Candidate> ScoreAll(const IndexSnapshot& snapshot, const QueryWeights& query,
                                const RankOptions& options) {
  std::vector<std::vector<Candidate>> found(snapshot.parts.size());
  ParallelFor(snapshot.parts.size(), ThreadsFor(snapshot, query, options.threads),
              [&](std::size_t i) {
                thread_local std::vector<float> sums;
                ScorePart(snapshot.parts[i], query, options, sums, found[i]);
              });
  std::vector<Candidate> all;
  std::size_t total = 0;
  for (const auto& part : found) total += part.size();
  all.reserve(total);
  for (const auto& part : found) all.insert(all.end(), part.begin(), part.end());
  return all;
}

std::vector<Candidate> BestOfEachObject(const std::vector<Candidate>& candidates) {
  std::vector<Candidate> best;
  std::unordered_map<std::int64_t, std::size_t> position;  // of an object in `best`
  position.reserve(candidates.size());
  for (const Candidate& candidate : candidates) {
    const std::int64_t object = candidate.segment->object(candidate.picture);
    if (object != 0) {
      const auto [found, is_new] = position.try_emplace(object, best.size());
      if (!is_new) {
        Candidate& held = best[found->second];
        if (IsBetter(candidate, held)) held = candidate;
        continue;
      }
    }
    best.push_back(candidate);
  }
  return best;
}

}  // namespace

Ranking Rank(const IndexSnapshot& snapshot, const Bow& query, const RankOptions& options) {
  const QueryWeights weights = WeighQuery(snapshot, query, options.method);
  std::vector<Candidate> candidates = ScoreAll(snapshot, weights, options);
  if (options.group_by == GroupBy::kObject) candidates = BestOfEachObject(candidates);
  Ranking ranking;
  ranking.total = candidates.size();
  if (options.keep != 0 && options.keep < candidates.size()) {
    const auto end = candidates.begin() + static_cast<std::ptrdiff_t>(options.keep);
    std::nth_element(candidates.begin(), end - 1, candidates.end(), IsBetter);
    candidates.erase(end, candidates.end());
  }
  std::sort(candidates.begin(), candidates.end(), IsBetter);
  ranking.best.reserve(candidates.size());
  for (const Candidate& c : candidates) {
    ranking.best.push_back({c.segment->key(c.picture), c.segment->object(c.picture),
                            std::string(c.segment->id(c.picture)), c.score});
  }
  return ranking;
}

}  // namespace pliant
