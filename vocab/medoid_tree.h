// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// k-medoids for more samples or medoids than FasterPAM can handle: a tree of two levels.
//
// 1. About sqrt(k) branches: FasterPAM on at most 8192 samples drawn at random, as in CLARA
//    (Kaufman and Rousseeuw 1990). Every sample is assigned to its nearest branch, exactly.
// 2. The k medoids are distributed over the branches in proportion to their samples' loss, and each
//    branch is clustered by FasterPAM. If a branch has more than 4096 samples (or 4 per medoid, if
//    that is more), that many are drawn.
// All medoids together are the result. Assignment does not use the tree; it remains exact.
//
// Cost: about n sqrt(k) d for the branches and, in each of sqrt(k) branches, FasterPAM on a few
// thousand samples. Memory: 64 MiB per thread and 12 bytes per sample in addition to the samples.
// The loss is a few per cent above FasterPAM's; `bench_vocab` prints both.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "descriptor/features/features.h"
#include "vocab/k_medoids.h"

namespace pliant {

// Finds equal descriptors. Internal to vocab/.

// The bytes of a row. Rows are equal when their bytes are.
std::string_view RowBytes(const Descriptors& descriptors, std::size_t row);

// `rows` without those equal to an earlier one, in the same order.
std::vector<std::uint32_t> DistinctRows(const Descriptors& descriptors,
                                        std::span<const std::uint32_t> rows);

// Vocabularies are trained by FasterPAM alone up to this many samples, by the tree above.
inline constexpr std::size_t kMaxExactSamples = 20'000;

struct MedoidTreeResult {
  std::vector<std::uint32_t> medoids;  // options.k row numbers, ascending, no two equal descriptors
  // The rows on which the loss was measured (drawn at random, or all if that is affordable), the
  // nearest medoid of each as a position in `medoids`, and the mean distance to it.
  std::vector<std::uint32_t> judged;
  std::vector<std::uint32_t> assignment;
  double mean_loss = 0;
};

// Throws kInvalidArgument "bad_k" for k outside 1..N or above the number of different samples,
// what KMedoids throws for malformed samples, kCancelled. max_passes and max_matrix_bytes are those
// of the FasterPAM runs. Deterministic for a seed and any number of threads. Thread-safe.
MedoidTreeResult MedoidTree(const Descriptors& samples, const KMedoidsOptions& options);

}  // namespace pliant
