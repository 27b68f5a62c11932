// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ranks the pictures of a snapshot in memory. Private to index/.
//
// kNeighbours: votes of the query's descriptors for pictures that have descriptors near them, see
//   neighbour_votes.h. 1 = a copy of the query, 0 = nothing nearer than usual; such pictures are no
//   hits.
// kTfIdf: cosine of the vectors tf * idf, tf = count / total, idf = ln((N + 1) / max(df, 1)):
//   score = sum_w tf_q tf_d idf_w^2 / (|q| |d|). 1 = same words in the same proportions, 0 = none
//   in common. Only pictures that share a word are hits. (Sivic and Zisserman, "Video Google", ICCV
//   2003; N + 1 keeps a word that every picture has above zero.)
// With signatures (vocab/signature.h) kTfIdf is, instead, ASMK's (Tolias, Avrithis and Jegou, ICCV
//   2013): score = sum_w idf_w s(h_w) / sqrt(sum_{w in q} idf_w sum_{w in d} idf_w) over the words
//   that q and d share; h_w = bits in which their signatures differ, s(h) = (1 - 2 h / 64)^5, 0
//   where that is below 0. Each word counts once however often it occurs, which is what tames
//   bursts. 1 = same words and signatures, 0 = nothing alike.
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
// kNeighbours counts as kTfIdf here.
Ranking Rank(const IndexSnapshot& snapshot, const Bow& query, const RankOptions& options);
// By kNeighbours. The snapshot must have codes; `quantizer`: of its vocabulary.
Ranking RankByNeighbours(const IndexSnapshot& snapshot, const Quantizer& quantizer,
                         const Voters& query, const RankOptions& options);

}  // namespace pliant
