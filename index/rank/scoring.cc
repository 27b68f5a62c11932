// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/scoring.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "descriptor/base/parallel.h"
#include "index/rank/neighbour_votes.h"

namespace pliant {
namespace {

// Fewer descriptors than this are not worth a second thread.
constexpr std::size_t kDescriptorsForThreads = 1u << 20;

// 1 - |h_q - h_d| / sqrt(2), with |h_q - h_d|^2 = h_q.h_q + h_d.h_d - 2 h_q.h_d.
double Score(const Bow& query, double query_squares, const IndexSegment& segment, std::size_t image,
             double dot) {
  const double query_total = query.total;
  const double total = segment.total(image);
  if (query_total == 0 || total == 0) return 0;
  const double squared_distance = query_squares / (query_total * query_total) +
                                  segment.sum_of_squares(image) / (total * total) -
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
    segment.codes().ForEachCount(word, [&](std::size_t image, std::size_t own) {
      dots[image] += weight * static_cast<double>(own);
    });
  }
  for (std::uint32_t p = 0; p < segment.size(); ++p) {
    if (part.IsDead(p) || !admission.Admits(segment.key(p), segment.object(p))) continue;
    candidates->push_back({&segment, p, Score(query, squares, segment, p, dots[p])});
  }
}

// With so many words, half of the lists find the same images in little more than half of the time
// (index/RANKING.md).
constexpr std::size_t kManyWords = 32'768;
constexpr int kCellsOfManyWords = 8;

}  // namespace

std::vector<Candidate> ScoreByHistogram(const IndexSnapshot& snapshot, const Bow& query,
                                        const RankOptions& options) {
  std::vector<std::vector<Candidate>> found(snapshot.parts.size());
  const int threads = query.total * snapshot.images < kDescriptorsForThreads ? 1 : options.threads;
  ParallelFor(found.size(), threads, [&](std::size_t i) {
    ScorePart(snapshot.parts[i], query, options.admission, &found[i]);
  });
  return Joined(found);
}

std::vector<std::vector<Vote>> CollectVotes(const NeighbourQuery& query,
                                            const IndexSnapshot& snapshot, int threads) {
  // Parts differ in size: slices of them keep all threads busy to the end.
  const auto slices = static_cast<std::size_t>(ResolveThreads(threads));
  std::vector<std::vector<Vote>> found(snapshot.parts.size() * slices);
  ParallelFor(found.size(), threads, [&](std::size_t i) {
    const IndexSnapshot::Part& part = snapshot.parts[i / slices];
    query.Collect(part.segment->codes(), part.dead.get(), i % slices, slices, &found[i]);
  });
  std::vector<std::vector<Vote>> votes(snapshot.parts.size());
  ParallelFor(votes.size(), threads, [&](std::size_t i) {
    for (std::size_t s = 0; s < slices; ++s) {
      const std::vector<Vote>& slice = found[i * slices + s];
      votes[i].insert(votes[i].end(), slice.begin(), slice.end());
    }
    KeepBest(&votes[i]);
  });
  return votes;
}

std::vector<Candidate> ScoreByNeighbours(const IndexSnapshot& snapshot, const Quantizer& quantizer,
                                         const Voters& voters, const RankOptions& options) {
  NeighbourOptions neighbours;
  neighbours.threads = options.threads;
  if (quantizer.vocabulary().size() >= kManyWords) neighbours.cells = kCellsOfManyWords;
  const NeighbourQuery query(quantizer, voters, neighbours);
  std::vector<std::vector<Vote>> votes = CollectVotes(query, snapshot, options.threads);
  query.Weigh(votes);
  std::vector<std::vector<Candidate>> found(votes.size());
  ParallelFor(votes.size(), options.threads, [&](std::size_t i) {
    const IndexSegment& segment = *snapshot.parts[i].segment;
    std::vector<float> sums(segment.size(), 0.0F);
    SumVotes(&votes[i], &sums);
    for (std::uint32_t p = 0; p < sums.size(); ++p) {
      if (sums[p] <= 0 || !options.admission.Admits(segment.key(p), segment.object(p))) continue;
      found[i].push_back({&segment, p, query.Score(sums[p], segment.total(p))});
    }
  });
  return Joined(found);
}

}  // namespace pliant
