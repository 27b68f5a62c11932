// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ranks the pictures of a snapshot in memory. Private to index/.
//
// kNeighbours: votes of the query's descriptors for pictures that have descriptors near them, see
//   neighbour_votes.h. 1 = a copy of the query, 0 = nothing nearer than usual; such pictures are no
//   hits.
// kHistogram: the paper's. h = count / total; score = 1 - |h_q - h_d| / sqrt(2). Every picture is
//   a hit; sqrt(2) is the distance of two pictures that are each all one word.
#pragma once

#include <cstddef>
#include <vector>

#include "index/rank/inverted_index.h"
#include "index/rank/neighbour_votes.h"
#include "index/rank/ranker.h"

namespace pliant {

// Only what is returned is sorted: O(postings + pictures), and n log n for the n that are returned.
// RankedPicture::ref has no collection: a snapshot does not know it.
Ranking RankByHistogram(const IndexSnapshot& snapshot, const Bow& query,
                        const RankOptions& options);
// `quantizer`: of the snapshot's vocabulary.
Ranking RankByNeighbours(const IndexSnapshot& snapshot, const Quantizer& quantizer,
                         const Voters& query, const RankOptions& options);

}  // namespace pliant
