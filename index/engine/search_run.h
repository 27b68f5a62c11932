// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One search: rank in memory, read what was ranked best in one batch, verify in memory. A second
// pass verifies the same ranking with more features of the query. Private to engine/.
#pragma once

#include <optional>
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
  // All must outlive it. The view must have a vocabulary. Ranks by `query`.
  SearchRun(MemoryRanker* ranker, Catalogue* source, const CollectionView& view,
            const Features& query, const SearchOptions& options);

  // Verifies with `features`: the query, or, in a second pass, what that has added to it. Timings
  // are those of all passes so far.
  SearchResult Run(const Features& features);

 private:
  bool KnowsProbabilities() const;
  Bow Quantize(const Features& features) const;
  RankOptions ToRankOptions() const;
  Ranking Rank(const RankOptions& options);
  void Fetch(const CandidateVerifier& verifier);
  // `ranking` becomes the one whose best, behind the verified, are the other hits.
  std::vector<VerifiedPicture> Verified(const Features& features, Ranking* ranking);
  void VerifyDeeper(CandidateVerifier* verifier, std::vector<VerifiedPicture>* hits,
                    Ranking* ranking);
  void Expand(CandidateVerifier* verifier, std::vector<VerifiedPicture>* hits, Ranking* ranking);
  std::vector<Hit> PageOf(std::vector<VerifiedPicture> hits);

  MemoryRanker& ranker_;
  Catalogue& source_;
  const CollectionView& view_;
  const Features& query_;
  const SearchOptions& options_;
  SearchTimings timings_;  // before what is timed while it is made
  const Bow bow_;
  const RankOptions rank_;
  PictureShelf shelf_;
  // By the query, for all passes.
  Ranking ranking_;
  std::optional<Ranking> deeper_;  // once a pass has needed it
  std::size_t depth_ = 0;          // pictures that this pass sets apart for verification
};

}  // namespace pliant
