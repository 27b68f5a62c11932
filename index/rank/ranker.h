// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which pictures of a collection are most like a query? The interface of everything that answers
// that: the inverted index in memory (memory_ranker.h), or an index in another process. All that
// goes in and comes out is data.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "descriptor/features/features.h"
#include "index/records/admission.h"
#include "index/records/picture_ref.h"
#include "index/records/search.h"
#include "vocab/quantizer.h"

namespace pliant {

// What a ranker has of a collection at a moment; each ranker has its own kind.
class RankerState {
 public:
  virtual ~RankerState() = default;
};

// One collection as a search sees it, from its beginning to its end. Immutable; everything in it
// belongs together.
struct CollectionView {
  Key collection = 0;
  Key vocabulary = 0;                          // 0 = none is active
  std::shared_ptr<const Quantizer> quantizer;  // nullptr = none is active
  std::shared_ptr<const RankerState> state;    // of the ranker that made the view; nullptr as above

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
  Admission admission;   // which pictures count at all; from Catalogue::Admit
  int threads = 1;       // at most; 0 = all cores
  // This many pictures, the best of all, are set apart for verification: by image, whatever their
  // score and object, since verification may lift any of them.
  std::size_t candidates = 0;
  // Further pictures, by version, ascending, that are set apart too if they are hits at all.
  std::vector<std::int64_t> also = {};
};

struct RankedPicture {
  PictureRef ref;
  Key object = 0;    // 0 = none
  double score = 0;  // 0..1
};

// Each list has the highest score first; of equal scores the lower id.
struct Ranking {
  std::vector<RankedPicture> candidates;
  // The hits that are no candidates, all after them. Grouped by object: the best picture of each
  // object stands for it (its score is the object's), a picture without object for itself, and
  // objects that a candidate shows are left out.
  std::vector<RankedPicture> best;
  std::size_t total = 0;  // of these hits, before `keep` cut them off
};

// Thread-safe. Throws what a database throws.
class Ranker {
 public:
  virtual ~Ranker() = default;

  // The present state: with everything that this process has written and, unless a collection is
  // just being loaded anew, with what others have. kNotFound "collection_not_found".
  virtual CollectionView View(const std::string& collection) = 0;
  virtual std::size_t Size(const CollectionView& view) const = 0;  // pictures; 0 without vocabulary
  // The view must have a vocabulary.
  virtual Ranking Rank(const CollectionView& view, const RankQuery& query,
                       const RankOptions& options) const = 0;

  // Makes ready what a first search would wait for.
  virtual void Load() = 0;
  // To be called after each commit of this process, before its writer returns: views that are made
  // from then on show it. Does nothing before the first load.
  virtual void Follow() = 0;
  // Loads what a switch to this vocabulary will need, so that the switch itself takes no time. Kept
  // as long as the result is.
  [[nodiscard]] virtual std::shared_ptr<const void> Prepare(Key collection, Key vocabulary) = 0;

  virtual std::size_t memory_bytes() const = 0;
  // ChangeFeed::Version when it last caught up with the store; 0 = never. Waits for nobody.
  virtual std::int64_t followed() const = 0;
  // Differences between the ranker and the store, as sentences.
  virtual std::vector<std::string> Check() = 0;
};

}  // namespace pliant
