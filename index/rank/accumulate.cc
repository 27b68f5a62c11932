// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/accumulate.h"

#include <bit>

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

// Counting bits is one instruction where the processor has it, and a dozen where it has not.
inline __attribute__((always_inline)) void AlikeLoop(const SignedPostings& postings,
                                                     const std::uint16_t* pictures, std::size_t n,
                                                     float* sums) {
  for (std::size_t i = 0; i < n; ++i) {
    const int bits = std::popcount(postings.signatures[i] ^ postings.signature);
    sums[pictures[i]] += postings.weights[bits];
  }
}

inline __attribute__((always_inline)) void AlikeDenseLoop(const SignedPostings& postings,
                                                          const std::uint8_t* counts, std::size_t n,
                                                          float* sums) {
  const std::uint64_t* own = postings.signatures;
  for (std::size_t p = 0; p < n; ++p) {
    if (counts[p] != 0) sums[p] += postings.weights[std::popcount(*own++ ^ postings.signature)];
  }
}

void AlikeBaseline(const SignedPostings& postings, const std::uint16_t* pictures, std::size_t n,
                   float* sums) {
  AlikeLoop(postings, pictures, n, sums);
}
void AlikeDenseBaseline(const SignedPostings& postings, const std::uint8_t* counts, std::size_t n,
                        float* sums) {
  AlikeDenseLoop(postings, counts, n, sums);
}

#if defined(__x86_64__) && defined(__GNUC__)
__attribute__((target("popcnt"))) void AlikePopcnt(const SignedPostings& postings,
                                                   const std::uint16_t* pictures, std::size_t n,
                                                   float* sums) {
  AlikeLoop(postings, pictures, n, sums);
}
__attribute__((target("popcnt"))) void AlikeDensePopcnt(const SignedPostings& postings,
                                                        const std::uint8_t* counts, std::size_t n,
                                                        float* sums) {
  AlikeDenseLoop(postings, counts, n, sums);
}

bool HasPopcnt() {
  __builtin_cpu_init();
  return __builtin_cpu_supports("popcnt") != 0;
}
#else
constexpr auto AlikePopcnt = AlikeBaseline;
constexpr auto AlikeDensePopcnt = AlikeDenseBaseline;
bool HasPopcnt() { return false; }
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

void AccumulateAlike(const SignedPostings& postings, const std::uint16_t* pictures, std::size_t n,
                     float* sums) {
  static const auto kernel = HasPopcnt() ? AlikePopcnt : AlikeBaseline;
  kernel(postings, pictures, n, sums);
}

void AccumulateAlikeDense(const SignedPostings& postings, const std::uint8_t* counts, std::size_t n,
                          float* sums) {
  static const auto kernel = HasPopcnt() ? AlikeDensePopcnt : AlikeDenseBaseline;
  kernel(postings, counts, n, sums);
}

}  // namespace pliant
