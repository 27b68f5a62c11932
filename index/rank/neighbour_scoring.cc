// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Scores by nearest neighbours: see neighbour_votes.h.
#include "descriptor/base/parallel.h"
#include "index/rank/neighbour_votes.h"
#include "index/rank/scoring.h"

namespace pliant {
namespace {

// With so many words, half of the lists find the same pictures in little more than half of the time
// (index/RANKING.md).
constexpr std::size_t kManyWords = 32'768;
constexpr int kCellsOfManyWords = 8;

}  // namespace

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
