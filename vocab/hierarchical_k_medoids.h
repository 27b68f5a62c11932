// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// k-medoids for more samples or medoids than FasterPAM can handle: FasterPAM makes about sqrt(k)
// branches from samples drawn at random, as in CLARA (Kaufman and Rousseeuw 1990), and clusters
// each branch for its share of the medoids; see vocab/README.md. Assignment does not use the
// hierarchy.
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

// Row numbers of descriptors. Internal to vocab/.

std::vector<std::uint32_t> AllRows(std::size_t n);  // 0 .. n - 1

// `count` of the rows drawn at random, ascending; all when there are no more.
std::vector<std::uint32_t> DrawRows(const std::vector<std::uint32_t>& rows, std::size_t count,
                                    std::uint64_t seed);

// The bytes of a row. Rows are equal when their bytes are.
std::string_view RowBytes(const Descriptors& descriptors, std::size_t row);

// `rows` without those equal to an earlier one, in the same order.
std::vector<std::uint32_t> DistinctRows(const Descriptors& descriptors,
                                        std::span<const std::uint32_t> rows);

// Vocabularies are trained by FasterPAM alone up to this many samples, by the hierarchy above.
inline constexpr std::size_t kMaxExactSamples = 10'000;

struct HierarchicalKMedoidsResult {
  std::vector<std::uint32_t> medoids;  // options.k row numbers, ascending, no two equal descriptors
  // The rows on which the loss was measured (drawn at random, or all if that is affordable), the
  // nearest medoid of each as a position in `medoids`, and the mean distance to it.
  std::vector<std::uint32_t> judged;
  std::vector<std::uint32_t> assignment;
  double mean_loss = 0;
};

// Throws kInvalidArgument "bad_k" for k outside 1..N or above the number of different samples,
// what KMedoids throws for malformed samples, kCancelled. max_passes is that of the
// FasterPAM runs. Deterministic for a seed and any number of threads. Thread-safe.
HierarchicalKMedoidsResult HierarchicalKMedoids(const Descriptors& samples,
                                                const KMedoidsOptions& options);

}  // namespace pliant
