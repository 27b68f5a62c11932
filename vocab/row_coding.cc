// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/row_coding.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#if defined(__x86_64__) && defined(__GNUC__)
#define PLIANT_AVX2 1
#include <immintrin.h>
#endif

namespace pliant {
namespace {

constexpr float kLargestFixed = 32767;

// Overflow wraps, as in the other kernel; only hostile codebooks have it.
std::int32_t Sum(std::int32_t a, std::int32_t b) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) + static_cast<std::uint32_t>(b));
}

// Of the two components of a pair.
std::int32_t Dot(const std::int16_t* a, const std::int16_t* b) {
  return Sum(a[0] * b[0], a[1] * b[1]);
}

#ifdef PLIANT_AVX2
#define PLIANT_INLINE_AVX2 __attribute__((target("avx2"), always_inline)) inline

PLIANT_INLINE_AVX2 __m256i Load(const void* from) {
  return _mm256_loadu_si256(static_cast<const __m256i*>(from));
}

// Two levels, each in a byte, twice.
std::uint32_t Twice(std::uint8_t levels) {
  return ((levels | static_cast<std::uint32_t>(levels) << 4U) & 0x0F0FU) * 0x10001U;
}

// 16 sums of products.
struct Wide {
  __m256i low;
  __m256i high;
};

PLIANT_INLINE_AVX2 void Widen(__m256i sums, Wide* wide) {
  wide->low = _mm256_add_epi32(wide->low, _mm256_cvtepi16_epi32(_mm256_castsi256_si128(sums)));
  wide->high =
      _mm256_add_epi32(wide->high, _mm256_cvtepi16_epi32(_mm256_extracti128_si256(sums, 1)));
}

PLIANT_INLINE_AVX2 __m256i ToFixed8(__m256i sums, const std::int32_t* middles, __m256 factor) {
  const __m256i twice = _mm256_sub_epi32(_mm256_slli_epi32(sums, 1), Load(middles));
  const __m256 value = _mm256_mul_ps(_mm256_cvtepi32_ps(twice), factor);
  const __m256 low = _mm256_min_ps(value, _mm256_set1_ps(kLargestFixed));
  return _mm256_cvtps_epi32(_mm256_max_ps(low, _mm256_set1_ps(-kLargestFixed)));
}

PLIANT_INLINE_AVX2 void Subtract(const Wide& sums, const std::int32_t* middles, __m256 factor,
                                 const std::int16_t* word, std::int16_t* residual) {
  const __m256i rotated = _mm256_packs_epi32(ToFixed8(sums.low, middles, factor),
                                             ToFixed8(sums.high, middles + 8, factor));
  const __m256i in_order = _mm256_permute4x64_epi64(rotated, 0xD8);
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(residual),
                      _mm256_subs_epi16(in_order, Load(word)));
}

__attribute__((target("avx2"))) void ResidualAvx2(const RowTables& tables, float factor,
                                                  const std::int16_t* word, RowScratch* scratch) {
  const __m256 factors = _mm256_set1_ps(factor);
  const std::size_t row = 2 * tables.outputs;
  for (std::size_t o = 0; o < tables.outputs; o += 32) {
    Wide sums[2] = {{_mm256_setzero_si256(), _mm256_setzero_si256()},
                    {_mm256_setzero_si256(), _mm256_setzero_si256()}};
    const std::int8_t* rotation = tables.rotation.data() + 2 * o;
    for (std::size_t first = 0; first < tables.pairs; first += kPairsAtOnce) {
      __m256i some[2] = {_mm256_setzero_si256(), _mm256_setzero_si256()};
      for (std::size_t j = first; j < first + kPairsAtOnce; ++j, rotation += row) {
        const __m256i levels = _mm256_set1_epi32(static_cast<std::int32_t>(scratch->levels[j]));
        some[0] = _mm256_add_epi16(some[0], _mm256_maddubs_epi16(levels, Load(rotation)));
        some[1] = _mm256_add_epi16(some[1], _mm256_maddubs_epi16(levels, Load(rotation + 32)));
      }
      Widen(some[0], &sums[0]);
      Widen(some[1], &sums[1]);
    }
    const std::int32_t* middles = tables.middles.data() + o;
    Subtract(sums[0], middles, factors, word + o, scratch->residual.data() + o);
    Subtract(sums[1], middles + 16, factors, word + o + 16, scratch->residual.data() + o + 16);
  }
}

// kPairs: of components of a part; the compiler makes better code of what it knows. 0: any.
template <std::size_t kPairs>
__attribute__((target("avx2"))) std::int32_t NearestAvx2(const RowTables& tables,
                                                         const std::int16_t* word,
                                                         RowScratch* scratch) {
  const std::size_t row = 2 * tables.lanes;  // outputs of a pair of components
  const std::size_t pairs = kPairs != 0 ? kPairs : tables.outputs / row;
  const std::size_t stride = pairs * tables.lanes;  // of a centroid, in pairs
  const std::int16_t* residual = scratch->residual.data();
  __m256i sums = _mm256_setzero_si256();
  for (std::size_t p = 0; p < tables.lanes; p += 8) {
    __m256i best = _mm256_set1_epi32(std::numeric_limits<std::int32_t>::max());
    const std::int32_t* norms = tables.norms.data() + p;
    const std::int16_t* centroid = tables.centroids.data() + 2 * p;
    for (std::size_t c = 0; c < kCentroids; ++c, norms += tables.lanes) {
      __m256i value = Load(norms);
      for (std::size_t i = 0; i < pairs; ++i, centroid += row) {
        const __m256i own = Load(residual + i * row + 2 * p);
        value = _mm256_sub_epi32(value, _mm256_madd_epi16(own, Load(centroid)));
      }
      best = _mm256_min_epi32(best, value);
    }
    const __m256i nearest = _mm256_and_si256(best, _mm256_set1_epi32(15));
    sums = _mm256_add_epi32(sums, _mm256_sub_epi32(best, nearest));
    std::int32_t* n = scratch->nearest.data() + p;
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(n), nearest);
    for (std::size_t i = 0; i < pairs; ++i) {
      const std::size_t o = i * row + 2 * p;
      std::int32_t chosen[8];  // pairs; gathering them takes longer
      for (std::size_t lane = 0; lane < 8; ++lane) {
        const std::size_t pair = static_cast<std::size_t>(n[lane]) * stride + o / 2 + lane;
        std::memcpy(chosen + lane, tables.centroids.data() + 2 * pair, sizeof(*chosen));
      }
      const __m256i loaded = Load(chosen);
      sums = _mm256_add_epi32(sums, _mm256_madd_epi16(Load(residual + o), loaded));
      sums = _mm256_add_epi32(sums, _mm256_madd_epi16(Load(word + o), loaded));
    }
  }
  std::int32_t each[8];
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(each), sums);
  std::int32_t sum = 0;
  for (const std::int32_t one : each) sum = Sum(sum, one);
  return sum;
}

std::int32_t CodeRowAvx2(const RowTables& tables, const std::uint8_t* levels, float factor,
                         const std::int16_t* word, RowScratch* scratch) {
  for (std::size_t j = 0; j < tables.bytes; ++j) scratch->levels[j] = Twice(levels[j]);
  ResidualAvx2(tables, factor, word, scratch);
  return tables.outputs == 2 * tables.lanes ? NearestAvx2<1>(tables, word, scratch)
                                            : NearestAvx2<0>(tables, word, scratch);
}
#endif

}  // namespace

std::int16_t ToFixed(float value) {
  const float low = value < kLargestFixed ? value : kLargestFixed;
  return static_cast<std::int16_t>(std::lrint(low > -kLargestFixed ? low : -kLargestFixed));
}

std::int32_t CodeRowAnywhere(const RowTables& tables, const std::uint8_t* levels, float factor,
                             const std::int16_t* word, RowScratch* scratch) {
  for (std::size_t o = 0; o < tables.outputs; ++o) {
    std::int32_t twice = -tables.middles[o];
    for (std::size_t j = 0; j < tables.bytes; ++j) {
      const std::int8_t* factors = tables.rotation.data() + 2 * (j * tables.outputs + o);
      twice += 2 * ((levels[j] & 15) * factors[0] + (levels[j] >> 4) * factors[1]);
    }
    const int difference = ToFixed(static_cast<float>(twice) * factor) - word[o];
    scratch->residual[o] = static_cast<std::int16_t>(std::clamp(difference, -32768, 32767));
  }
  const std::size_t row = 2 * tables.lanes;
  const std::int16_t* residual = scratch->residual.data();
  std::int32_t sum = 0;
  for (std::size_t p = 0; p < tables.lanes; ++p) {
    std::int32_t best = std::numeric_limits<std::int32_t>::max();
    for (std::size_t c = 0; c < kCentroids; ++c) {
      std::int32_t dot = 0;
      for (std::size_t o = 2 * p; o < tables.outputs; o += row) {
        dot = Sum(dot, Dot(residual + o, tables.centroids.data() + c * tables.outputs + o));
      }
      best = std::min(best, Sum(tables.norms[c * tables.lanes + p], Sum(~dot, 1)));
    }
    const std::int32_t nearest = best & 15;
    scratch->nearest[p] = nearest;
    sum = Sum(sum, best - nearest);
    const auto c = static_cast<std::size_t>(nearest);
    for (std::size_t o = 2 * p; o < tables.outputs; o += row) {
      const std::int16_t* chosen = tables.centroids.data() + c * tables.outputs + o;
      sum = Sum(sum, Sum(Dot(residual + o, chosen), Dot(word + o, chosen)));
    }
  }
  return sum;
}

std::int32_t CodeRow(const RowTables& tables, const std::uint8_t* levels, float factor,
                     const std::int16_t* word, RowScratch* scratch) {
#ifdef PLIANT_AVX2
  static const bool has_avx2 = __builtin_cpu_supports("avx2") != 0;
  if (has_avx2) return CodeRowAvx2(tables, levels, factor, word, scratch);
#endif
  return CodeRowAnywhere(tables, levels, factor, word, scratch);
}

}  // namespace pliant
