// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ranks the images of a snapshot in memory. Private to index/.
//
// kNeighbours: votes of the query's descriptors for images that have descriptors near them, see
//   neighbour_votes.h. 1 = a copy of the query, 0 = nothing nearer than usual; such images are no
//   hits.
// kHistogram: the paper's. h = count / total; score = 1 - |h_q - h_d| / sqrt(2). Every image is
//   a hit; sqrt(2) is the distance of two images that are each all one word.
#pragma once

#include <cstddef>
#include <vector>

#include "index/rank/inverted_index.h"
#include "index/rank/neighbour_votes.h"
#include "index/rank/ranker.h"

namespace pliant {

// Only what is returned is sorted: O(postings + images), and n log n for the n that are returned.
// RankedImage::ref has no collection: a snapshot does not know it.
Ranking RankByHistogram(const IndexSnapshot& snapshot, const Bow& query,
                        const RankOptions& options);
// `quantizer`: of the snapshot's vocabulary.
Ranking RankByNeighbours(const IndexSnapshot& snapshot, const Quantizer& quantizer,
                         const Voters& query, const RankOptions& options);

}  // namespace pliant
