// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Verification of the best pictures of a ranking, and the ranking by the combined scores. Private
// to index/.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "descriptor/features.h"
#include "index/explanation.h"
#include "index/ranking.h"
#include "index/verification.h"

namespace pliant {

struct VerifiedPicture {
  RankedPicture picture;  // score: CombineScores of the ranking's score and the inliers
  int inliers = 0;
  std::vector<Vec2> outline;               // in the query picture; empty when not verified
  std::optional<Explanation> explanation;  // of the pictures looked at, when asked for
};

// How many pictures are verified when nobody says: 100, or the square root of the collection's size
// where that is more, so that true matches do not vanish behind a fixed depth as it grows.
std::size_t DefaultVerifyDepth(std::size_t pictures);

struct RerankOptions {
  std::size_t depth = 100;  // pictures looked at, from the first
  bool explain = false;
  int threads = 1;  // pictures at a time; 0 = all cores
};

// Verifies the first pictures of `ranking` (by image, best first) and sorts all by combined score,
// then id. `load` gives a picture's features, or nothing for one that
// was removed meanwhile, which is left unverified; it is called from several threads.
// Deterministic.
std::vector<VerifiedPicture> Rerank(
    const Features& query, std::vector<RankedPicture> ranking, const RerankOptions& options,
    const std::function<std::optional<Features>(std::int64_t key)>& load);

// Keeps the best picture of each object; a picture without object stands for itself.
void KeepBestOfObjects(std::vector<VerifiedPicture>* pictures);

}  // namespace pliant
