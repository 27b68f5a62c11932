// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Scores by bags of words: see ranking.h.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "descriptor/base/parallel.h"
#include "index/rank/scoring.h"

namespace pliant {
namespace {

using Part = IndexSnapshot::Part;

// Fewer posting-list steps than this are not worth a second thread.
constexpr std::size_t kStepsForThreads = 1u << 20;

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
        static_cast<float>(method == RankMethod::kHistogram ? count : count * idf * idf));
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
  const bool tf_idf = options.method != RankMethod::kHistogram;
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

}  // namespace

std::vector<Candidate> ScoreByWords(const IndexSnapshot& snapshot, const Bow& query,
                                    const RankOptions& options) {
  const bool is_signed = options.method != RankMethod::kHistogram && options.signatures &&
                         !query.signatures.empty() && snapshot.has_signatures();
  const QueryWeights weights =
      is_signed ? WeighSigned(snapshot, query) : WeighQuery(snapshot, query, options.method);
  std::vector<std::vector<Candidate>> found(snapshot.parts.size());
  const int threads = ThreadsFor(snapshot, weights, options.threads);
  std::vector<std::vector<float>> sums(ParallelWorkers(found.size(), threads));
  ParallelForWorkers(found.size(), threads, [&](std::size_t i, std::size_t worker) {
    ScorePart(snapshot.parts[i], weights, options, sums[worker], found[i]);
  });
  return Joined(found);
}

}  // namespace pliant
