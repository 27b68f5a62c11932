// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// k-medoids for more samples or medoids than FasterPAM takes: a tree of two levels.
//
// 1. About sqrt(k) branches: FasterPAM on at most 8192 samples drawn at random, as in CLARA
// (Kaufman and
//    Rousseeuw 1990). Every sample goes to its nearest branch, exactly.
// 2. The k medoids are shared out to the branches in proportion to their samples' loss, and each
//    branch is clustered by FasterPAM; of a branch with more than 4096 samples (or 4 a medoid) that
//    many are drawn.
// All medoids together are the result: assignment does not use the tree, it stays exact.
//
// Cost: about n sqrt(k) d for the branches and, in each of sqrt(k) branches, FasterPAM on a few
// thousand samples; memory: 64 MiB a thread and 12 bytes a sample beside the samples. The price is
// a loss some per cent above FasterPAM's; `bench_vocab` prints both.
#pragma once

#include <cstdint>
#include <vector>

#include "descriptor/features/features.h"
#include "vocab/k_medoids.h"

namespace pliant {

// More samples than this make a vocabulary by the tree, up to this by FasterPAM alone.
inline constexpr std::size_t kMaxExactSamples = 20'000;

struct MedoidTreeResult {
  std::vector<std::uint32_t> medoids;  // options.k row numbers, ascending, no two equal descriptors
  // Rows drawn at random (all, where that is affordable), each one's nearest medoid as a position
  // in `medoids`, and their mean distance to it.
  std::vector<std::uint32_t> judged;
  std::vector<std::uint32_t> assignment;
  double mean_loss = 0;
};

// Throws kInvalidArgument "bad_k" for k outside 1..N or above the number of different samples,
// what KMedoids throws for malformed samples, kCancelled. max_passes and max_matrix_bytes are those
// of the FasterPAM runs. Deterministic for a seed, whatever the number of threads. Thread-safe.
MedoidTreeResult MedoidTree(const Descriptors& samples, const KMedoidsOptions& options);

}  // namespace pliant
