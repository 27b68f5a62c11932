// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Verifies what was ranked, a batch of it at a time. Private to engine/.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "index/engine/picture_shelf.h"
#include "index/records/search.h"
#include "index/verify/rerank.h"

namespace pliant {

class CandidateVerifier {
 public:
  // All must outlive it. Times are added to `timings`.
  CandidateVerifier(const Features& query, const SearchOptions& options, PictureShelf* shelf,
                    SearchTimings* timings);

  // Of so many candidates those that are surely looked at: worth reading with the first batch.
  std::span<const RankedPicture> FirstBatch(std::span<const RankedPicture> candidates) const;

  // In their order, the verified ones first: as many as it takes (IsEnough), or all where the
  // search names its depth. The others as they were ranked.
  std::vector<VerifiedPicture> Verify(std::vector<RankedPicture> candidates);

  std::vector<VerifiedPicture> VerifyAll(std::vector<RankedPicture> candidates);

 private:
  std::size_t BatchAfter(std::size_t looked_at) const;
  void VerifyBatch(std::vector<RankedPicture> batch, std::vector<VerifiedPicture>* verified);
  std::vector<VerifiedPicture> Run(std::vector<RankedPicture> candidates, bool all);

  const Features& query_;
  const SearchOptions& options_;
  PictureShelf& shelf_;
  SearchTimings& timings_;
};

}  // namespace pliant
