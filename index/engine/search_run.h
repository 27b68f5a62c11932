// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One search: rank in memory, read the best images in one batch, verify in memory. A second pass
// verifies the same ranking with more features of the query. Private to engine/.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "index/engine/engine_core.h"
#include "index/rank/ranking.h"
#include "index/records/search.h"
#include "index/store/catalogue.h"
#include "index/verify/rerank.h"

namespace pliant {

// The candidates of one search, read from the store in batches. An image that was replaced after
// the ranking is kept in its new state, under the ranked version, so that no search misses it.
// Fetch: one thread. Other methods: any thread, while no Fetch runs.
class CandidateCache {
 public:
  // Omits new states that `admission` does not admit. Both must outlive the cache.
  CandidateCache(Catalogue* source, const Admission* admission, std::string model_id)
      : source_(*source), admission_(*admission), model_id_(std::move(model_id)) {}

  // Reads the missing ones in one batch.
  void Fetch(std::span<const RankedImage> images, Load what);
  void DropFeatures();

  // nullptr, nullopt: the image was removed.
  const ImageRecord* Record(std::int64_t version) const;
  std::optional<Features> LoadFeatures(std::int64_t version) const;

 private:
  Catalogue& source_;
  const Admission& admission_;
  std::string model_id_;
  std::unordered_map<std::int64_t, std::optional<StoredImage>> images_;  // by ranked version
};

class CandidateVerifier;

// Sets `found` and `perhaps` by the probabilities of all hits, best first, and result->found_from.
template <typename Hits>
void Judge(const Hits& hits, SearchResult* result) {
  const auto found = std::ranges::count_if(
      hits, [&](const auto& hit) { return hit.probability >= result->found_from; });
  result->found = static_cast<std::size_t>(found);
  result->perhaps = found == 0 && !hits.empty() && hits.front().probability >= kPerhapsProbability;
}

class SearchRun {
 public:
  // All must outlive it. The view must have a vocabulary. Ranks by `query`.
  SearchRun(EngineCore* core, const CollectionView& view, const Features& query,
            const SearchOptions& options);

  // Verifies with `features`: the query, or in a second pass the added features. Timings include
  // all passes so far.
  SearchResult Run(const Features& features);
  // Whether the last Run found nothing only because rivals share a probability that would be enough
  // for one: a second pass would not tell them apart.
  bool undecided() const { return undecided_; }

 private:
  bool KnowsProbabilities() const;
  RankQuery ToRankQuery();
  RankOptions ToRankOptions() const;
  Ranking Rank(const RankOptions& options);
  void Fetch(const CandidateVerifier& verifier);
  // Sets `ranking` to the one that gives the hits after the verified ones.
  std::vector<VerifiedImage> Verified(const Features& features, Ranking* ranking);
  void VerifyDeeper(CandidateVerifier* verifier, std::vector<VerifiedImage>* hits,
                    Ranking* ranking);
  std::vector<Hit> PageOf(std::vector<VerifiedImage> hits);

  EngineCore& core_;
  const CollectionView& view_;
  const Features& query_;
  const SearchOptions& options_;
  SearchTimings timings_;  // declared before the members that it times
  const RankQuery ranked_by_;
  const RankOptions rank_;
  CandidateCache cache_;
  // The ranking by the query, for all passes.
  Ranking ranking_;
  std::optional<Ranking> deeper_;  // set when a pass needs it
  std::size_t depth_ = 0;          // images that this pass verifies
  bool undecided_ = false;
  const double found_from_;  // CollectionRecord
};

}  // namespace pliant
