// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/seeding.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <random>

namespace pliant {
namespace {

// A number in [0, 1) from the generator's upper 53 bits: the same on every standard library,
// which std::uniform_real_distribution does not promise.
double Uniform(std::mt19937_64* generator) {
  return static_cast<double>((*generator)() >> 11) * 0x1.0p-53;
}

}  // namespace

std::vector<std::uint32_t> SeedMedoids(const DistanceRows& rows, std::size_t k, std::uint64_t seed,
                                       const std::function<void(double done)>& checkpoint) {
  const std::size_t n = rows.size();
  std::mt19937_64 generator(seed);
  std::vector<float> nearest(n, std::numeric_limits<float>::infinity());
  std::vector<char> taken(n, 0);
  std::vector<float> buffer(rows.in_memory() ? 0 : n);
  std::vector<std::uint32_t> medoids;
  const auto take = [&](std::size_t row) {
    medoids.push_back(static_cast<std::uint32_t>(row));
    taken[row] = 1;
    if (!rows.in_memory()) rows.Compute(row, 1, buffer.data());
    const float* distances = rows.in_memory() ? rows.Stored(row) : buffer.data();
    for (std::size_t i = 0; i < n; ++i) nearest[i] = std::min(nearest[i], distances[i]);
  };
  take(std::min(n - 1, static_cast<std::size_t>(Uniform(&generator) * static_cast<double>(n))));
  while (medoids.size() < k) {
    if (medoids.size() % 64 == 0) {
      checkpoint(static_cast<double>(medoids.size()) / static_cast<double>(k));
    }
    double total = 0;
    for (const float d : nearest) total += d;
    if (total <= 0) break;
    double left = Uniform(&generator) * total;
    std::size_t chosen = n;
    for (std::size_t i = 0; i < n && (chosen == n || left > 0); ++i) {
      if (nearest[i] <= 0) continue;
      chosen = i;
      left -= nearest[i];
    }
    take(chosen);
  }
  for (std::size_t i = 0; i < n && medoids.size() < k; ++i) {
    if (taken[i] == 0) medoids.push_back(static_cast<std::uint32_t>(i));
  }
  return medoids;
}

}  // namespace pliant
