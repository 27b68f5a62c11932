// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Verification of the best pictures of a ranking, and their order by the combined scores. Private
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
  RankedPicture picture;            // score: CombineScores of the ranking's score and the inliers
  std::vector<Instance> instances;  // as in Hit
  std::optional<Explanation> explanation;  // of the pictures looked at, when asked for

  int inliers() const { return instances.empty() ? 0 : instances.front().inliers; }
};

// How many pictures are verified when nobody says: 100, or the square root of the collection's size
// where that is more, so that true matches do not vanish behind a fixed depth as it grows.
std::size_t DefaultVerifyDepth(std::size_t pictures);

struct RerankOptions {
  int max_instances = 1;
  bool explain = false;
  int threads = 1;  // pictures at a time; 0 = all cores
};

// Verifies the pictures of `ranking` and sorts them by combined score, then id. `load` gives a
// picture's features, or nothing for one that was removed meanwhile, which is left unverified; it
// is called from several threads. Deterministic.
std::vector<VerifiedPicture> Rerank(
    const Features& query, std::vector<RankedPicture> ranking, const RerankOptions& options,
    const std::function<std::optional<Features>(std::int64_t key)>& load);

// Keeps the best picture of each object; a picture without object stands for itself.
void KeepBestOfObjects(std::vector<VerifiedPicture>* pictures);

}  // namespace pliant
