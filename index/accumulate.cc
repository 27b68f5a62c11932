// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/accumulate.h"

namespace pliant {
namespace {

// No fused multiply-add: it would round differently from the posting lists' loop.
inline __attribute__((always_inline)) void Loop(const std::uint8_t* counts, std::size_t n,
                                                float weight, float* sums) {
  for (std::size_t i = 0; i < n; ++i) sums[i] += weight * static_cast<float>(counts[i]);
}

void Baseline(const std::uint8_t* counts, std::size_t n, float weight, float* sums) {
  Loop(counts, n, weight, sums);
}

#if defined(__x86_64__) && defined(__GNUC__)
__attribute__((target("avx2"))) void Avx2(const std::uint8_t* counts, std::size_t n, float weight,
                                          float* sums) {
  Loop(counts, n, weight, sums);
}

bool HasAvx2() {
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx2") != 0;
}
#endif

using Kernel = void (*)(const std::uint8_t*, std::size_t, float, float*);

Kernel Choose() {
#if defined(__x86_64__) && defined(__GNUC__)
  if (HasAvx2()) return Avx2;
#endif
  return Baseline;
}

}  // namespace

void AccumulateDense(std::span<const std::uint8_t> counts, float weight, float* sums) {
  static const Kernel kernel = Choose();
  kernel(counts.data(), counts.size(), weight, sums);
}

}  // namespace pliant
