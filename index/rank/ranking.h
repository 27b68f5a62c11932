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
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
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
  std::string name;
  Key collection = 0;
  Key vocabulary = 0;                             // 0 = none is active
  std::shared_ptr<const Quantizer> quantizer;     // nullptr = none is active
  std::shared_ptr<const IndexSnapshot> snapshot;  // nullptr as above

  bool has_vocabulary() const { return quantizer != nullptr; }
};

// What ranks the images. Its data can be sent to another process.
struct RankQuery {
  RankMethod method = RankMethod::kNeighbours;
  // kNeighbours: in stored precision, with a weight of each row, and the nearest words of each row.
  Descriptors descriptors = {};
  std::vector<float> weights = {};  // above 0; empty: 1 each
  std::vector<NearWord> words = {};
  Bow bow = {};  // kHistogram: the query's, in the view's vocabulary
};

struct RankOptions {
  GroupBy group_by = GroupBy::kImage;
  std::size_t keep = 0;      // best entries returned; 0 = all
  double min_score = 0;      // lower scores are no hits
  Admission admission = {};  // which images count at all; from Catalogue::Admit
  int threads = 1;           // at most; 0 = all cores
  // Number of candidates for verification, from the number of images in the collection: the best
  // images, independent of score and object, since verification can raise any of them. Empty: none.
  std::function<std::size_t(std::size_t images)> candidates = {};
  bool partial = false;  // also if some parts of the index do not answer
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
  std::size_t depth = 0;  // number of candidates that RankOptions asks for
  double searched = 1;    // share of the index that was ranked (RankOptions::partial)
};

// What a part of an index contributes to a ranking.
struct PartRanking {
  std::vector<RankedImage> candidates;  // the part's best images, as many as all parts together
  // The best of the others, at most as many as `keep` and the candidates together.
  std::vector<RankedImage> best;
  // Grouped by object: the objects of the others, each once; ascending if there are other parts.
  std::vector<Key> objects;
  std::size_t alone = 0;  // number of the others that no object represents
};

// Ranks the images of a snapshot, which is an index or a part of one, in two steps: a query
// descriptor's votes weigh less the more images of all parts it votes for.
class PartRanker {
 public:
  // The first step. `quantizer`: of the snapshot's vocabulary. All must outlive it.
  PartRanker(const IndexSnapshot& snapshot, const Quantizer& quantizer, const RankQuery& query,
             int threads);

  // Number of images that each row of the query votes for; empty for kHistogram.
  const std::vector<std::uint32_t>& voted() const { return voted_; }
  // The second step, once. `voted`: sum over all parts. `candidates`: as all parts together.
  PartRanking Rank(std::span<const std::uint32_t> voted, std::size_t candidates,
                   const RankOptions& options);

 private:
  const IndexSnapshot& snapshot_;
  const RankQuery& query_;
  std::optional<NeighbourQuery> neighbours_;  // kNeighbours
  std::vector<std::vector<Vote>> votes_;      // by part of the snapshot
  std::vector<std::uint32_t> voted_;
};

// The ranking of the whole index from those of its parts: the same for any division into parts.
Ranking Merge(std::vector<PartRanking> parts, std::size_t candidates, const RankOptions& options);

// A query of kNeighbours for a vocabulary.
RankQuery NeighboursOf(Descriptors descriptors, std::vector<float> weights,
                       const Quantizer& quantizer, int threads);

// The query's votes for the images of each part, by row, then by image.
std::vector<std::vector<Vote>> CollectVotes(const NeighbourQuery& query,
                                            const IndexSnapshot& snapshot, int threads);

// Of an index in one part. Sorts only the returned images: O(postings + images), and n log n for
// the n returned. RankedImage::ref has no collection: a snapshot does not know it.
Ranking Rank(const IndexSnapshot& snapshot, const Quantizer& quantizer, const RankQuery& query,
             const RankOptions& options);

}  // namespace pliant
