// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ranks the images of a snapshot in memory. Private to index/.
//
// kNeighbours: votes of the query's descriptors for images that have descriptors near them, see
//   neighbour_votes.h. 1 = a copy of the query, 0 = nothing nearer than usual; such images are no
//   hits.
// kHistogram: the paper's. h = count / total; score = 1 - |h_q - h_d| / sqrt(2). Every image is a
//   hit; sqrt(2) is the distance of two images that consist of one word each.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "descriptor/features/features.h"
#include "index/rank/inverted_index.h"
#include "index/rank/neighbour_votes.h"
#include "index/records/image_ref.h"
#include "index/records/search.h"
#include "vocab/quantizer.h"

namespace pliant {

// One collection as seen by one search from begin to end. Immutable and consistent.
struct CollectionView {
  Key collection = 0;
  Key vocabulary = 0;                             // 0 = none is active
  std::shared_ptr<const Quantizer> quantizer;     // nullptr = none is active
  std::shared_ptr<const IndexSnapshot> snapshot;  // nullptr as above

  bool has_vocabulary() const { return quantizer != nullptr; }
};

struct RankQuery {
  const Features& features;  // in stored precision: kNeighbours
  const Bow& bow;            // of them, in the view's vocabulary: kHistogram
};

struct RankOptions {
  RankMethod method = RankMethod::kNeighbours;
  GroupBy group_by = GroupBy::kImage;
  std::size_t keep = 0;  // best entries returned; 0 = all
  double min_score = 0;  // lower scores are no hits
  Admission admission;   // which images count at all; from Catalogue::Admit
  int threads = 1;       // at most; 0 = all cores
  // Number of candidates for verification: the best images, independent of score and object, since
  // verification can raise any of them.
  std::size_t candidates = 0;
};

struct RankedImage {
  ImageRef ref;
  Key object = 0;    // 0 = none
  double score = 0;  // 0..1
};

// Each list has the highest score first; of equal scores the lower id.
struct Ranking {
  std::vector<RankedImage> candidates;
  // The other hits, which rank after all candidates. Grouped by object: each object is represented
  // by its best image, with that image's score. An image without object represents itself. Objects
  // of candidates are omitted.
  std::vector<RankedImage> best;
  std::size_t total = 0;  // number of these hits, before the limit `keep`
};

// The query's votes for the images of each part, by row, then by image.
std::vector<std::vector<Vote>> CollectVotes(const NeighbourQuery& query,
                                            const IndexSnapshot& snapshot, int threads);

// Sorts only the returned images: O(postings + images), and n log n for the n returned.
// RankedImage::ref has no collection: a snapshot does not know it.
Ranking RankByHistogram(const IndexSnapshot& snapshot, const Bow& query,
                        const RankOptions& options);
// `quantizer`: of the snapshot's vocabulary.
Ranking RankByNeighbours(const IndexSnapshot& snapshot, const Quantizer& quantizer,
                         const Voters& query, const RankOptions& options);

}  // namespace pliant
