// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/ranking.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <string_view>
#include <unordered_map>
#include <unordered_set>

#include "descriptor/base/parallel.h"

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

constexpr int kSelectivity = 5;  // the power of s(h), see ranking.h

// idf s(h) for each number h of differing bits.
BitWeights WeightsOfBits(double idf) {
  BitWeights weights = {};
  for (int h = 0; 2 * h < kSignatureBits; ++h) {
    weights[static_cast<std::size_t>(h)] =
        static_cast<float>(idf * std::pow(1 - 2.0 * h / kSignatureBits, kSelectivity));
  }
  return weights;
}

struct QueryWeights {
  std::vector<std::uint32_t> words;
  std::vector<float> weights;
  double total = 0;
  double norm = 0;     // |q| of tf-idf, with counts for tf
  double squares = 0;  // sum of squared counts
  // With signatures; norm is then sqrt of the sum of the words' idf.
  std::vector<std::uint64_t> signatures;
  std::vector<BitWeights> bit_weights;
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

QueryWeights WeighSigned(const IndexSnapshot& snapshot, const Bow& query) {
  QueryWeights result;
  for (std::size_t i = 0; i < query.words.size(); ++i) {
    const std::uint32_t word = query.words[i].word;
    if (word >= snapshot.vocabulary_size) continue;
    const double idf = snapshot.statistics->idf[word];
    result.norm += idf;
    result.words.push_back(word);
    result.signatures.push_back(query.signatures[i]);
    result.bit_weights.push_back(WeightsOfBits(idf));
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
  const bool is_signed = !query.signatures.empty();
  for (std::size_t i = 0; i < query.words.size(); ++i) {
    if (is_signed) {
      segment.AccumulateAlike(query.words[i], query.signatures[i], query.bit_weights[i],
                              sums.data());
    } else {
      segment.Accumulate(query.words[i], query.weights[i], sums.data());
    }
  }
  const std::vector<float>& norms = is_signed ? *part.inverse_alike_norms : *part.inverse_norms;
  const bool tf_idf = options.method == RankMethod::kTfIdf;
  const bool all = options.admission.everything();
  for (std::uint32_t p = 0; p < segment.size(); ++p) {
    if ((tf_idf && sums[p] <= 0) || part.IsDead(p)) continue;
    if (!all && !options.admission.Admits(segment.key(p), segment.object(p))) continue;
    const double score = tf_idf
                             ? std::min(1.0, static_cast<double>(sums[p]) * norms[p] / query.norm)
                             : HistogramScore(query, segment, p, sums[p]);
    candidates.push_back({&segment, p, score});
  }
}

int ThreadsFor(const IndexSnapshot& snapshot, const QueryWeights& query, int threads) {
  return query.words.size() * snapshot.pictures < kStepsForThreads ? 1 : threads;
}

std::vector<Candidate> ScoreAll(const IndexSnapshot& snapshot, const QueryWeights& query,
                                const RankOptions& options) {
  std::vector<std::vector<Candidate>> found(snapshot.parts.size());
  const int threads = ThreadsFor(snapshot, query, options.threads);
  std::vector<std::vector<float>> sums(ParallelWorkers(found.size(), threads));
  ParallelForWorkers(found.size(), threads, [&](std::size_t i, std::size_t worker) {
    ScorePart(snapshot.parts[i], query, options, sums[worker], found[i]);
  });
  std::vector<Candidate> all;
  std::size_t total = 0;
  for (const auto& part : found) total += part.size();
  all.reserve(total);
  for (const auto& part : found) all.insert(all.end(), part.begin(), part.end());
  return all;
}

std::vector<Candidate> BestOfEachObject(std::span<const Candidate> candidates,
                                        const std::unordered_set<std::int64_t>& but_not) {
  std::vector<Candidate> best;
  std::unordered_map<std::int64_t, std::size_t> position;  // of an object in `best`
  for (const Candidate& candidate : candidates) {
    const std::int64_t object = candidate.segment->object(candidate.picture);
    if (object != 0) {
      if (but_not.contains(object)) continue;
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

// The best `count` in order at the front; nothing is said about the others.
void SortBest(std::span<Candidate> candidates, std::size_t count) {
  if (count == 0) return;
  if (count < candidates.size()) {
    std::nth_element(candidates.begin(),
                     candidates.begin() + static_cast<std::ptrdiff_t>(count - 1), candidates.end(),
                     IsBetter);
    candidates = candidates.first(count);
  }
  std::sort(candidates.begin(), candidates.end(), IsBetter);
}

std::vector<RankedPicture> Named(std::span<const Candidate> candidates) {
  std::vector<RankedPicture> named;
  named.reserve(candidates.size());
  for (const Candidate& c : candidates) {
    named.push_back({{0, std::string(c.segment->id(c.picture)), c.segment->key(c.picture)},
                     c.segment->object(c.picture),
                     c.score});
  }
  return named;
}

}  // namespace

Ranking Rank(const IndexSnapshot& snapshot, const Bow& query, const RankOptions& options) {
  const bool is_signed = options.method == RankMethod::kTfIdf && options.signatures &&
                         !query.signatures.empty() && snapshot.has_signatures();
  const QueryWeights weights =
      is_signed ? WeighSigned(snapshot, query) : WeighQuery(snapshot, query, options.method);
  std::vector<Candidate> all = ScoreAll(snapshot, weights, options);
  Ranking ranking;
  const std::size_t apart = std::min(options.candidates, all.size());
  SortBest(all, apart);
  auto others = all.begin() + static_cast<std::ptrdiff_t>(apart);
  if (!options.also.empty()) {
    const auto first = others;
    others = std::partition(first, all.end(), [&](const Candidate& c) {
      return std::binary_search(options.also.begin(), options.also.end(),
                                c.segment->key(c.picture));
    });
    std::sort(first, others, IsBetter);
  }
  ranking.candidates = Named({all.begin(), others});
  std::vector<Candidate> rest(others, all.end());
  std::erase_if(rest, [&](const Candidate& c) { return c.score < options.min_score; });
  if (options.group_by == GroupBy::kObject) {
    std::unordered_set<std::int64_t> shown;
    for (const RankedPicture& candidate : ranking.candidates) shown.insert(candidate.object);
    rest = BestOfEachObject(rest, shown);
  }
  ranking.total = rest.size();
  const std::size_t keep = options.keep == 0 ? rest.size() : std::min(options.keep, rest.size());
  SortBest(rest, keep);
  ranking.best = Named(std::span(rest).first(keep));
  return ranking;
}

}  // namespace pliant
