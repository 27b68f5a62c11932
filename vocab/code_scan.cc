// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/code_scan.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>
#endif

namespace pliant {
namespace {

constexpr std::size_t kCentroids = 16;

using Sums = std::array<std::uint16_t, kCodeBlock>;
using Biases = std::array<std::int16_t, kCodeBlock>;
using Distances = std::array<float, kCodeBlock>;

// distance = base + step * sum + bias_step * bias
struct Scale {
  float base = 0;
  float step = 0;
  float bias_step = 0;
  float limit = 0;
};

// sums[i] = what the table has for code i of a block of n codes, i < n. Whole numbers: at most 255
// for each of at most 256 parts, so 16 bits hold them, and every processor gives the same.
void SumBlock(const std::uint8_t* codes, std::size_t n, std::size_t bytes,
              const std::uint8_t* table, Sums* sums) {
  sums->fill(0);
  for (std::size_t j = 0; j < bytes; ++j) {
    const std::uint8_t* low = table + 2 * j * kCentroids;
    const std::uint8_t* high = low + kCentroids;
    for (std::size_t i = 0; i < n; ++i) {
      const std::uint8_t code = codes[j * n + i];
      (*sums)[i] = static_cast<std::uint16_t>((*sums)[i] + low[code & 15U] + high[code >> 4U]);
    }
  }
}

// Bit i of the result: code i is nearer than the limit.
std::uint32_t Compare(const Sums& sums, const Biases& biases, const Scale& scale,
                      Distances* distances) {
  std::uint32_t nearer = 0;
  for (std::size_t i = 0; i < kCodeBlock; ++i) {
    (*distances)[i] = scale.base + scale.step * static_cast<float>(sums[i]) +
                      scale.bias_step * static_cast<float>(biases[i]);
    nearer |= static_cast<std::uint32_t>((*distances)[i] < scale.limit) << i;
  }
  return nearer;
}

#if defined(__x86_64__) && defined(__GNUC__)
// The table's 16 bytes of a part are one register, and the shuffle looks up 32 codes at once.
// Sums of even and odd lanes are kept apart, because there is no addition of bytes into 16 bits:
// `all` adds both bytes of each 16-bit lane, `odd` the upper ones alone, and the lower are what is
// left when these are taken away.
__attribute__((target("avx2"))) void SumBlockAvx2(const std::uint8_t* codes, std::size_t n,
                                                  std::size_t bytes, const std::uint8_t* table,
                                                  Sums* sums) {
  const __m256i nibble = _mm256_set1_epi8(15);
  __m256i all = _mm256_setzero_si256();
  __m256i odd = _mm256_setzero_si256();
  for (std::size_t j = 0; j < bytes; ++j) {
    const __m256i code = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(codes + j * n));
    const __m128i* rows = reinterpret_cast<const __m128i*>(table + 2 * j * kCentroids);
    const __m256i low = _mm256_broadcastsi128_si256(_mm_loadu_si128(rows));
    const __m256i high = _mm256_broadcastsi128_si256(_mm_loadu_si128(rows + 1));
    const __m256i a = _mm256_shuffle_epi8(low, _mm256_and_si256(code, nibble));
    const __m256i b =
        _mm256_shuffle_epi8(high, _mm256_and_si256(_mm256_srli_epi16(code, 4), nibble));
    all = _mm256_add_epi16(all, _mm256_add_epi16(a, b));
    odd = _mm256_add_epi16(odd, _mm256_add_epi16(_mm256_srli_epi16(a, 8), _mm256_srli_epi16(b, 8)));
  }
  const __m256i even = _mm256_sub_epi16(all, _mm256_slli_epi16(odd, 8));
  const __m256i first = _mm256_unpacklo_epi16(even, odd);   // lanes 0..7 and 16..23
  const __m256i second = _mm256_unpackhi_epi16(even, odd);  // lanes 8..15 and 24..31
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(sums->data()),
                      _mm256_permute2x128_si256(first, second, 0x20));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(sums->data() + 16),
                      _mm256_permute2x128_si256(first, second, 0x31));
}

// No fused multiply-add, so that the rounding is Compare's.
__attribute__((target("avx2"))) std::uint32_t CompareAvx2(const Sums& sums, const Biases& biases,
                                                          const Scale& scale,
                                                          Distances* distances) {
  const __m256 base = _mm256_set1_ps(scale.base);
  const __m256 step = _mm256_set1_ps(scale.step);
  const __m256 bias_step = _mm256_set1_ps(scale.bias_step);
  const __m256 limit = _mm256_set1_ps(scale.limit);
  std::uint32_t nearer = 0;
  for (std::size_t i = 0; i < kCodeBlock; i += 8) {
    const auto* sum = reinterpret_cast<const __m128i*>(sums.data() + i);
    const auto* bias = reinterpret_cast<const __m128i*>(biases.data() + i);
    const __m256 s = _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(_mm_loadu_si128(sum)));
    const __m256 b = _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(_mm_loadu_si128(bias)));
    const __m256 distance =
        _mm256_add_ps(_mm256_add_ps(base, _mm256_mul_ps(step, s)), _mm256_mul_ps(bias_step, b));
    _mm256_storeu_ps(distances->data() + i, distance);
    const int mask = _mm256_movemask_ps(_mm256_cmp_ps(distance, limit, _CMP_LT_OQ));
    nearer |= static_cast<std::uint32_t>(mask) << i;
  }
  return nearer;
}
#endif

struct KernelSet {
  void (*sum)(const std::uint8_t*, std::size_t, std::size_t, const std::uint8_t*, Sums*) = SumBlock;
  std::uint32_t (*compare)(const Sums&, const Biases&, const Scale&, Distances*) = Compare;
};

KernelSet Choose() {
#if defined(__x86_64__) && defined(__GNUC__)
  if (__builtin_cpu_supports("avx2") != 0) return {SumBlockAvx2, CompareAvx2};
#endif
  return {};
}

std::size_t ScanFloats(const CodeList& list, const CodeQuery& query, NearCode* near) {
  static const KernelSet kernels = Choose();
  const LookupTable& table = *query.table;
  const Scale scale{query.base + table.offset, table.step, query.bias_step, query.limit};
  std::size_t found = 0;
  Sums sums;
  Biases biases = {};
  Distances distances;
  for (std::size_t first = 0; first < list.size; first += kCodeBlock) {
    const std::size_t n = std::min(kCodeBlock, list.size - first);
    kernels.sum(list.codes + first * list.bytes, n, list.bytes, table.entries.data(), &sums);
    std::copy_n(list.biases + first, n, biases.begin());
    std::uint32_t nearer = kernels.compare(sums, biases, scale, &distances);
    if (n < kCodeBlock) nearer &= (std::uint32_t{1} << n) - 1;  // the rest is what came before
    for (; nearer != 0; nearer &= nearer - 1) {
      const auto i = static_cast<std::size_t>(std::countr_zero(nearer));
      near[found++] = {static_cast<std::uint32_t>(first + i), std::max(0.0F, distances[i])};
    }
  }
  return found;
}

std::size_t ScanBits(const CodeList& list, const CodeQuery& query, NearCode* near) {
  std::size_t found = 0;
  for (std::size_t first = 0; first < list.size; first += kCodeBlock) {
    const std::size_t n = std::min(kCodeBlock, list.size - first);
    const std::uint8_t* block = list.codes + first * list.bytes;
    std::array<std::uint16_t, kCodeBlock> bits = {};
    for (std::size_t j = 0; j < list.bytes; ++j) {
      for (std::size_t i = 0; i < n; ++i) {
        const auto differ = static_cast<std::uint8_t>(block[j * n + i] ^ query.bits[j]);
        bits[i] = static_cast<std::uint16_t>(bits[i] + std::popcount(differ));
      }
    }
    for (std::size_t i = 0; i < n; ++i) {
      if (static_cast<float>(bits[i]) < query.limit) {
        near[found++] = {static_cast<std::uint32_t>(first + i), static_cast<float>(bits[i])};
      }
    }
  }
  return found;
}

}  // namespace

void AppendCodes(const std::uint8_t* codes, std::size_t count, std::size_t bytes,
                 std::vector<std::uint8_t>* list) {
  list->resize(list->size() + count * bytes);
  std::uint8_t* out = list->data() + list->size() - count * bytes;
  for (std::size_t first = 0; first < count; first += kCodeBlock) {
    const std::size_t n = std::min(kCodeBlock, count - first);
    for (std::size_t j = 0; j < bytes; ++j) {
      for (std::size_t i = 0; i < n; ++i) *out++ = codes[(first + i) * bytes + j];
    }
  }
}

void CopyCode(const CodeList& list, std::size_t i, std::uint8_t* code) {
  const std::size_t first = i / kCodeBlock * kCodeBlock;
  const std::size_t n = std::min(kCodeBlock, list.size - first);
  for (std::size_t j = 0; j < list.bytes; ++j) {
    code[j] = list.codes[first * list.bytes + j * n + (i - first)];
  }
}

void Prefetch(const CodeList& list) {
#if defined(__GNUC__)
  constexpr std::size_t kLine = 64;
  constexpr std::size_t kAhead = 16 * kLine;  // what follows, the processor sees coming
  const std::size_t bytes = std::min(kAhead, list.size * list.bytes);
  for (std::size_t i = 0; i < bytes; i += kLine) __builtin_prefetch(list.codes + i);
  if (list.biases != nullptr) __builtin_prefetch(list.biases);
#endif
}

std::size_t ScanCodes(const CodeList& list, const CodeQuery& query, NearCode* near) {
  return query.table != nullptr ? ScanFloats(list, query, near) : ScanBits(list, query, near);
}

}  // namespace pliant
