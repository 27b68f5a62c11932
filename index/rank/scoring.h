// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The scores of a snapshot's images, before any is chosen. Private to index/rank/.
#pragma once

#include <cstdint>
#include <vector>

#include "index/rank/inverted_index.h"
#include "index/rank/neighbour_votes.h"
#include "index/rank/ranker.h"

namespace pliant {

struct Candidate {
  const IndexSegment* segment = nullptr;
  std::uint32_t image = 0;
  double score = 0;
};

// The images that are hits at all and that options.admission admits, in no order. Neither depends
// on how the images are spread over segments.
std::vector<Candidate> ScoreByHistogram(const IndexSnapshot& snapshot, const Bow& query,
                                        const RankOptions& options);
// The query's votes for the images of each part, by row, then by image.
std::vector<std::vector<Vote>> CollectVotes(const NeighbourQuery& query,
                                            const IndexSnapshot& snapshot, int threads);
std::vector<Candidate> ScoreByNeighbours(const IndexSnapshot& snapshot, const Quantizer& quantizer,
                                         const Voters& query, const RankOptions& options);

std::vector<Candidate> Joined(const std::vector<std::vector<Candidate>>& parts);

}  // namespace pliant
