// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Included once for each instruction set (base/kernel_sets.inl).

namespace pliant::sift::PLIANT_KERNELS {
namespace {

#include "descriptor/base/kernel_vectors.inl"

constexpr int kDifferences = kLevels - 1;
using Bits = std::int32_t __attribute__((vector_size(kWidth * sizeof(std::int32_t))));
using UnalignedBits =
    std::int32_t __attribute__((vector_size(kWidth * sizeof(std::int32_t)), aligned(4), may_alias));

PLIANT_INLINE Vec Larger(const Vec& a, const Vec& b) { return a > b ? a : b; }
PLIANT_INLINE Vec Smaller(const Vec& a, const Vec& b) { return a < b ? a : b; }

// Two rows, kVectors wide: each row of the source but the outermost is in both sums, and is loaded
// once.
template <int kVectors>
PLIANT_INLINE void BlurTwoRows(const float* const* rows, const float* taps, int radius, int x,
                               float* upper, float* lower) {
  Vec sums[kVectors];
  Vec lower_sums[kVectors];
  Vec above[kVectors];  // the last row above that was added
  Vec below[kVectors];
#pragma GCC unroll 4
  for (int v = 0; v < kVectors; ++v) {
    above[v] = Load(rows[radius] + x + v * kWidth);
    below[v] = Load(rows[radius + 1] + x + v * kWidth);
    sums[v] = above[v] * taps[0];
    lower_sums[v] = below[v] * taps[0];
  }
  for (int j = 1; j <= radius; ++j) {
#pragma GCC unroll 4
    for (int v = 0; v < kVectors; ++v) {
      const Vec further_above = Load(rows[radius - j] + x + v * kWidth);
      const Vec further_below = Load(rows[radius + 1 + j] + x + v * kWidth);
      sums[v] += (further_above + below[v]) * taps[j];
      lower_sums[v] += (above[v] + further_below) * taps[j];
      above[v] = further_above;
      below[v] = further_below;
    }
  }
#pragma GCC unroll 4
  for (int v = 0; v < kVectors; ++v) {
    Store(sums[v], upper + x + v * kWidth);
    Store(lower_sums[v], lower + x + v * kWidth);
  }
}

void BlurColumns(const float* const* rows, const float* taps, int radius, int left, int right,
                 float* upper, float* lower) {
  constexpr int kVectors = 4;
  int x = left;
  for (; x + kVectors * kWidth <= right; x += kVectors * kWidth) {
    BlurTwoRows<kVectors>(rows, taps, radius, x, upper, lower);
  }
  for (; x < right; x += kWidth) BlurTwoRows<1>(rows, taps, radius, x, upper, lower);
}

// kVectors at once hide the latency of the sums.
template <int kVectors>
PLIANT_INLINE void BlurAt(const float* row, const float* taps, int radius, float* out) {
  Vec sums[kVectors];
#pragma GCC unroll 4
  for (int v = 0; v < kVectors; ++v) sums[v] = Load(row + v * kWidth) * taps[0];
  for (int j = 1; j <= radius; ++j) {
#pragma GCC unroll 4
    for (int v = 0; v < kVectors; ++v) {
      sums[v] += (Load(row + v * kWidth - j) + Load(row + v * kWidth + j)) * taps[j];
    }
  }
#pragma GCC unroll 4
  for (int v = 0; v < kVectors; ++v) Store(sums[v], out + v * kWidth);
}

void BlurRow(const float* row, const float* taps, int radius, int width, float* out) {
  constexpr int kVectors = 4;
  int x = 0;
  for (; x + kVectors * kWidth <= width; x += kVectors * kWidth) {
    BlurAt<kVectors>(row + x, taps, radius, out + x);
  }
  for (; x < width; x += kWidth) BlurAt<1>(row + x, taps, radius, out + x);
}

void FindExtrema(const LevelRows& rows, float threshold, int width, int stride, float* scratch,
                 std::int32_t* found) {
  // Of each layer: the differences, and the extremes of the 9 neighbours in the same column.
  float* const values = scratch;
  float* const highs = values + kLayers * stride;
  float* const lows = highs + kLayers * stride;
  for (int x = 0; x < width; x += kWidth) {
    Vec level[3];
    Vec high[kDifferences];
    Vec low[kDifferences];
#pragma GCC unroll 3
    for (int r = 0; r < 3; ++r) level[r] = Load(rows[0][r] + x);
#pragma GCC unroll 5
    for (int d = 0; d < kDifferences; ++d) {
      Vec difference[3];
#pragma GCC unroll 3
      for (int r = 0; r < 3; ++r) {
        const Vec above = Load(rows[d + 1][r] + x);
        difference[r] = above - level[r];
        level[r] = above;
      }
      high[d] = Larger(Larger(difference[0], difference[2]), difference[1]);
      low[d] = Smaller(Smaller(difference[0], difference[2]), difference[1]);
      if (d > 0 && d <= kLayers) Store(difference[1], values + (d - 1) * stride + x);
    }
#pragma GCC unroll 3
    for (int i = 0; i < kLayers; ++i) {
      Store(Larger(Larger(high[i], high[i + 2]), high[i + 1]), highs + i * stride + x);
      Store(Smaller(Smaller(low[i], low[i + 2]), low[i + 1]), lows + i * stride + x);
    }
  }
  for (int x = 0; x < width; x += kWidth) {
    const int at = x == 0 ? 1 : x;  // there are no neighbours left of the first
    Bits bits = {};
#pragma GCC unroll 3
    for (int i = 0; i < kLayers; ++i) {
      const Vec value = Load(values + i * stride + at);
      const float* const h = highs + i * stride + at;
      const float* const l = lows + i * stride + at;
      const Vec high = Larger(Larger(Load(h - 1), Load(h + 1)), Load(h));
      const Vec low = Smaller(Smaller(Load(l - 1), Load(l + 1)), Load(l));
      const Bits is =
          ((value > threshold) & (value >= high)) | ((value < -threshold) & (value <= low));
      bits |= is & (1 << i);
    }
    *reinterpret_cast<UnalignedBits*>(found + at) = bits;
  }
}

}  // namespace

extern const Kernels kTable;
const Kernels kTable = {PLIANT_TEXT(PLIANT_KERNELS), BlurColumns, BlurRow, FindExtrema};

}  // namespace pliant::sift::PLIANT_KERNELS
