// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/engine/candidate_verifier.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "descriptor/base/stopwatch.h"

namespace pliant {
namespace {

// Features of so many pictures are in memory at a time.
constexpr std::size_t kPicturesABatch = 256;
// So many are looked at before it is asked whether they are enough.
constexpr std::size_t kFirstPictures = 30;

}  // namespace

CandidateVerifier::CandidateVerifier(const Features& query, const SearchOptions& options,
                                     PictureShelf* shelf, SearchTimings* timings)
    : query_(query), options_(options), shelf_(*shelf), timings_(*timings) {}

std::span<const RankedPicture> CandidateVerifier::FirstBatch(
    std::span<const RankedPicture> candidates) const {
  return candidates.first(std::min(candidates.size(), BatchAfter(0)));
}

std::vector<VerifiedPicture> CandidateVerifier::Verify(std::vector<RankedPicture> candidates) {
  return Run(std::move(candidates), /*all=*/options_.verify_depth != 0);
}

std::vector<VerifiedPicture> CandidateVerifier::VerifyAll(std::vector<RankedPicture> candidates) {
  return Run(std::move(candidates), /*all=*/true);
}

// How many pictures are looked at next, after so many.
std::size_t CandidateVerifier::BatchAfter(std::size_t looked_at) const {
  if (options_.verify_depth != 0) return kPicturesABatch;
  return std::clamp(looked_at, kFirstPictures, kPicturesABatch);
}

void CandidateVerifier::VerifyBatch(std::vector<RankedPicture> batch,
                                    std::vector<VerifiedPicture>* verified) {
  {
    const ScopedStopwatch watch(&timings_.database_ms);
    if (!verified->empty()) shelf_.DropFeatures();
    shelf_.Fetch(batch, Load::kRecordsAndFeatures);  // nothing to do for the first
  }
  const ScopedStopwatch watch(&timings_.verify_ms);
  auto hits = Rerank(query_, std::move(batch),
                     {.max_instances = options_.max_instances,
                      .explain = options_.explain,
                      .threads = options_.threads},
                     [&](std::int64_t version) { return shelf_.LoadFeatures(version); });
  std::move(hits.begin(), hits.end(), std::back_inserter(*verified));
}

std::vector<VerifiedPicture> CandidateVerifier::Run(std::vector<RankedPicture> candidates,
                                                    bool all) {
  std::vector<VerifiedPicture> verified;
  while (verified.size() < candidates.size()) {
    const auto begin = candidates.begin() + static_cast<std::ptrdiff_t>(verified.size());
    const auto left = static_cast<std::size_t>(candidates.end() - begin);
    const auto end =
        begin + static_cast<std::ptrdiff_t>(std::min(left, BatchAfter(verified.size())));
    VerifyBatch({std::make_move_iterator(begin), std::make_move_iterator(end)}, &verified);
    if (!all && IsEnough(verified)) break;
  }
  for (std::size_t i = verified.size(); i < candidates.size(); ++i) {
    const double score = candidates[i].score;
    verified.push_back({.picture = std::move(candidates[i]), .ranking_score = score});
  }
  return verified;
}

}  // namespace pliant
