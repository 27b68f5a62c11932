// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One search: rank in memory, read what was ranked best in one batch, verify in memory. A second
// pass verifies the same ranking with more features of the query. Private to engine/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "index/rank/memory_ranker.h"
#include "index/rank/ranking.h"
#include "index/records/search.h"
#include "index/store/catalogue.h"
#include "index/verify/rerank.h"

namespace pliant {

// The candidates of one search, read from the store in batches. An image that was replaced since
// it was ranked is kept in its new state, under the version that was ranked, so that no search
// misses it. Fetch: one thread. The rest: any, when no Fetch runs.
class CandidateCache {
 public:
  // New states that `admission` would not have admitted are left out. Both must outlive the cache.
  CandidateCache(Catalogue* source, const Admission* admission, std::string model_id)
      : source_(*source), admission_(*admission), model_id_(std::move(model_id)) {}

  // Reads those that are not there yet, all at once.
  void Fetch(std::span<const RankedImage> images, Load what);
  void DropFeatures();

  // nullptr, nullopt: the image is gone.
  const ImageRecord* Record(std::int64_t version) const;
  std::optional<Features> LoadFeatures(std::int64_t version) const;

 private:
  Catalogue& source_;
  const Admission& admission_;
  std::string model_id_;
  std::unordered_map<std::int64_t, std::optional<StoredImage>> images_;  // by ranked version
};

class CandidateVerifier;

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
  std::vector<VerifiedImage> Verified(const Features& features, Ranking* ranking);
  void VerifyDeeper(CandidateVerifier* verifier, std::vector<VerifiedImage>* hits,
                    Ranking* ranking);
  void Expand(CandidateVerifier* verifier, std::vector<VerifiedImage>* hits, Ranking* ranking);
  std::vector<Hit> PageOf(std::vector<VerifiedImage> hits);

  MemoryRanker& ranker_;
  Catalogue& source_;
  const CollectionView& view_;
  const Features& query_;
  const SearchOptions& options_;
  SearchTimings timings_;  // before what is timed while it is made
  const Bow bow_;
  const RankOptions rank_;
  CandidateCache cache_;
  // By the query, for all passes.
  Ranking ranking_;
  std::optional<Ranking> deeper_;  // once a pass has needed it
  std::size_t depth_ = 0;          // images that this pass sets apart for verification
};

}  // namespace pliant
