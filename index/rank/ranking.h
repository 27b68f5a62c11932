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

// One collection as a search sees it, from its beginning to its end. Immutable; everything in it
// belongs together.
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
  // The best images, this many, become candidates for verification: by image, independent of score
  // and object, since verification may lift any of them.
  std::size_t candidates = 0;
  // Further images, by version, ascending, that become candidates if they are hits at all.
  std::vector<std::int64_t> also = {};
};

struct RankedImage {
  ImageRef ref;
  Key object = 0;    // 0 = none
  double score = 0;  // 0..1
};

// Each list has the highest score first; of equal scores the lower id.
struct Ranking {
  std::vector<RankedImage> candidates;
  // The hits that are no candidates, all after them. Grouped by object: the best image of each
  // object stands for it (its score is the object's), an image without object for itself, and
  // objects that a candidate shows are left out.
  std::vector<RankedImage> best;
  std::size_t total = 0;  // of these hits, before `keep` cut them off
};

// The query's votes for the images of each part, by row, then by image.
std::vector<std::vector<Vote>> CollectVotes(const NeighbourQuery& query,
                                            const IndexSnapshot& snapshot, int threads);

// Only what is returned is sorted: O(postings + images), and n log n for the n that are returned.
// RankedImage::ref has no collection: a snapshot does not know it.
Ranking RankByHistogram(const IndexSnapshot& snapshot, const Bow& query,
                        const RankOptions& options);
// `quantizer`: of the snapshot's vocabulary.
Ranking RankByNeighbours(const IndexSnapshot& snapshot, const Quantizer& quantizer,
                         const Voters& query, const RankOptions& options);

}  // namespace pliant
