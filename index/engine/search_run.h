// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One search: rank in memory, read what was ranked best in one batch, verify in memory. Private to
// engine/.
#pragma once

#include <vector>

#include "index/engine/candidate_verifier.h"
#include "index/engine/picture_shelf.h"
#include "index/rank/memory_ranker.h"
#include "index/records/search.h"
#include "index/store/catalogue.h"
#include "index/verify/rerank.h"

namespace pliant {

// Throws kInvalidArgument that names the option.
void Validate(const SearchOptions& options);

class SearchRun {
 public:
  // All must outlive it. The view must have a vocabulary. Ranks by `query`, and verifies with
  // `closer`: the same, or what a closer look has added to it.
  SearchRun(MemoryRanker* ranker, Catalogue* source, const CollectionView& view,
            const Features& query, const Features& closer, const SearchOptions& options);

  SearchResult Run();

 private:
  bool KnowsProbabilities() const;
  Bow Quantize(const Features& features) const;
  RankOptions ToRankOptions() const;
  void Fetch(const Ranking& ranking);
  void LookDeeper(std::vector<VerifiedPicture>* hits, Ranking* ranking);
  void Expand(std::vector<VerifiedPicture>* hits, Ranking* ranking);
  std::vector<Hit> PageOf(std::vector<VerifiedPicture> hits);

  MemoryRanker& ranker_;
  Catalogue& source_;
  const CollectionView& view_;
  const Features& query_;
  const Features& closer_;
  const SearchOptions& options_;
  SearchTimings timings_;  // before what is timed while it is made
  const Bow bow_;
  RankOptions rank_;
  PictureShelf shelf_;
  CandidateVerifier verifier_;
};

}  // namespace pliant
