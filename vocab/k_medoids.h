// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// k-medoids clustering: FasterPAM.
//
// E. Schubert and P. J. Rousseeuw, "Fast and eager k-medoids clustering: O(k) runtime improvement
// of the PAM, CLARA, and CLARANS algorithms", Information Systems 101, 2021. Each pass over the
// candidates costs O(n^2) (not O(k n^2)); memory is the n x n distance matrix in float32.
#pragma once

#include <cstdint>
#include <functional>
#include <stop_token>
#include <vector>

#include "descriptor/features.h"

namespace pliant {

struct KMedoidsOptions {
  int k = 10;              // number of medoids, 1..N
  std::uint64_t seed = 1;  // same seed, same result, whatever the number of threads
  int threads = 0;         // 0 = all cores
  int max_passes = 0;      // passes over all candidates; 0 = until no swap improves
  // Called now and then with the share of the work done (0..1) and the current loss.
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

// Clusters the rows (Euclidean distance for floats, Hamming for binary). Throws kInvalidArgument
// for k outside 1..N, non-finite values, or N above what fits the distance matrix
// (kMaxKMedoidsSamples). Deterministic for a seed.
inline constexpr std::size_t kMaxKMedoidsSamples = 32768;
KMedoidsResult KMedoids(const Descriptors& samples, const KMedoidsOptions& options);

}  // namespace pliant
