// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// k-medoids clustering: FasterPAM.
//
// E. Schubert and P. J. Rousseeuw, "Fast and eager k-medoids clustering: O(k) runtime improvement
// of the PAM, CLARA, and CLARANS algorithms", Information Systems 101, 2021. Seeded like k-means++
// with chances proportional to the distance, O(k n); then each pass over the n candidates costs O(n
// (n + k)) where PAM's costs O(k n^2), and a swap O(n + k times the samples that lose their
// medoid). Memory: the n x n distance matrix in float32.
#pragma once

#include <cstdint>
#include <functional>
#include <stop_token>
#include <vector>

#include "descriptor/features/features.h"

namespace pliant {

struct KMedoidsOptions {
  int k = 10;              // number of medoids, 1..N
  std::uint64_t seed = 1;  // same seed, same result, for any number of threads
  int threads = 0;         // 0 = all cores
  int max_passes = 0;      // passes over all candidates; 0 = until no swap improves
  // Called periodically with the fraction of the work done (0..1) and the current loss.
  std::function<void(double done, double loss)> progress;
  std::stop_token stop;  // a stop request ends in Error kCancelled
};

struct KMedoidsResult {
  std::vector<std::uint32_t> medoids;     // k row numbers, ascending
  std::vector<std::uint32_t> assignment;  // N: position in `medoids` of the nearest one
  double loss = 0;                        // sum of distances to the nearest medoid
  int swaps = 0;
  int passes = 0;
  bool converged = false;  // no single swap lowers the loss any further
};

// Clusters the rows (Euclidean distance for floats, Hamming for binary). With max_passes 0 the
// result is a local optimum of PAM's SWAP: no exchange of one medoid for another row lowers the
// loss (by more than 1e-10 of it). Medoids are distinct rows; they can be equal descriptors if
// fewer than k differ. Throws kInvalidArgument "bad_k" for k outside 1..N, "too_many_samples",
// "descriptors_not_finite", "descriptors_out_of_range" (distances overflow),
// "descriptors_malformed"; kCancelled. Deterministic for a seed. Thread-safe.
inline constexpr std::size_t kMaxKMedoidsSamples = 16384;  // a matrix of 1 GiB
KMedoidsResult KMedoids(const Descriptors& samples, const KMedoidsOptions& options);

}  // namespace pliant
