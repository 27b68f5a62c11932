// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Scores by histograms of words: see ranking.h.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "descriptor/base/parallel.h"
#include "index/rank/scoring.h"

namespace pliant {
namespace {

// Fewer descriptors than this are not worth a second thread.
constexpr std::size_t kDescriptorsForThreads = 1u << 20;

// 1 - |h_q - h_d| / sqrt(2), with |h_q - h_d|^2 = h_q.h_q + h_d.h_d - 2 h_q.h_d.
double Score(const Bow& query, double query_squares, const IndexSegment& segment,
             std::size_t picture, double dot) {
  const double query_total = query.total;
  const double total = segment.total(picture);
  if (query_total == 0 || total == 0) return 0;
  const double squared_distance = query_squares / (query_total * query_total) +
                                  segment.sum_of_squares(picture) / (total * total) -
                                  2 * dot / (query_total * total);
  return std::max(0.0, 1 - std::sqrt(std::max(0.0, squared_distance)) / std::numbers::sqrt2);
}

void ScorePart(const IndexSnapshot::Part& part, const Bow& query, const Admission& admission,
               std::vector<Candidate>* candidates) {
  const IndexSegment& segment = *part.segment;
  std::vector<double> dots(segment.size(), 0.0);  // whole numbers: exact in any order
  double squares = 0;
  for (const auto& [word, count] : query.words) {
    const double weight = count;
    squares += weight * weight;
    segment.codes().ForEachCount(word, [&](std::size_t picture, std::size_t own) {
      dots[picture] += weight * static_cast<double>(own);
    });
  }
  for (std::uint32_t p = 0; p < segment.size(); ++p) {
    if (part.IsDead(p) || !admission.Admits(segment.key(p), segment.object(p))) continue;
    candidates->push_back({&segment, p, Score(query, squares, segment, p, dots[p])});
  }
}

}  // namespace

std::vector<Candidate> ScoreByHistogram(const IndexSnapshot& snapshot, const Bow& query,
                                        const RankOptions& options) {
  std::vector<std::vector<Candidate>> found(snapshot.parts.size());
  const int threads =
      query.total * snapshot.pictures < kDescriptorsForThreads ? 1 : options.threads;
  ParallelFor(found.size(), threads, [&](std::size_t i) {
    ScorePart(snapshot.parts[i], query, options.admission, &found[i]);
  });
  return Joined(found);
}

}  // namespace pliant
