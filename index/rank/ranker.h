// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What MemoryRanker is asked, and what it answers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "descriptor/features/features.h"
#include "index/records/image_ref.h"
#include "index/records/search.h"
#include "vocab/quantizer.h"

namespace pliant {

struct IndexSnapshot;

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
  // This many images, the best of all, are set apart for verification: by image, whatever their
  // score and object, since verification may lift any of them.
  std::size_t candidates = 0;
  // Further images, by version, ascending, that are set apart too if they are hits at all.
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

}  // namespace pliant
