// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Included once for each instruction set (base/kernel_sets.inl).

namespace pliant::kernels::PLIANT_KERNELS {
namespace {

#include "descriptor/base/kernel_vectors.inl"

using Whole = std::uint32_t __attribute__((vector_size(kWidth * sizeof(std::uint32_t))));
using StoredWhole = std::uint32_t
    __attribute__((vector_size(kWidth * sizeof(std::uint32_t)), aligned(4), may_alias));

// The tile that fills the registers of the instruction set.
constexpr int kTileRows = kWidth == 16 ? 8 : (kWidth == 8 ? 2 : 4);
constexpr int kVectors = kWidth == 8 ? 4 : 2;
constexpr bool kFused = kWidth > 4;  // see SquaredNorms

// kRows x (kVectors * kWidth) sums at once in registers. Sums run over the components in order,
// so each value is the same whatever the tile.
template <int kRows, bool kDifference>
PLIANT_INLINE void Tile(const float* a, std::size_t dim, const float* panel, float* out) {
  Vec sums[kRows][kVectors];
#pragma GCC unroll 8
  for (int r = 0; r < kRows; ++r) {
#pragma GCC unroll 4
    for (int v = 0; v < kVectors; ++v) sums[r][v] = Vec{};
  }
  for (std::size_t p = 0; p < dim; ++p) {
    Vec b[kVectors];
#pragma GCC unroll 4
    for (int v = 0; v < kVectors; ++v) b[v] = Load(panel + p * kPanel + v * kWidth);
#pragma GCC unroll 8
    for (int r = 0; r < kRows; ++r) {
      const float x = a[r * dim + p];
#pragma GCC unroll 4
      for (int v = 0; v < kVectors; ++v) {
        if constexpr (kDifference) {
          const Vec d = b[v] - x;
          sums[r][v] += d * d;
        } else {
          sums[r][v] += b[v] * x;
        }
      }
    }
  }
#pragma GCC unroll 8
  for (int r = 0; r < kRows; ++r) {
#pragma GCC unroll 4
    for (int v = 0; v < kVectors; ++v) Store(sums[r][v], out + r * kPanel + v * kWidth);
  }
}

template <int kRows, bool kDifference>
void Tiles(const float* a, std::size_t rows, std::size_t dim, const float* panel, float* out) {
  for (std::size_t c = 0; c < kPanel; c += kWidth * kVectors) {
    std::size_t r = 0;
    for (; r + kRows <= rows; r += kRows) {
      Tile<kRows, kDifference>(a + r * dim, dim, panel + c, out + r * kPanel + c);
    }
    for (; r < rows; ++r) {
      Tile<1, kDifference>(a + r * dim, dim, panel + c, out + r * kPanel + c);
    }
  }
}

// kFused: the instruction set has fused multiply-add, into which the compiler contracts Tile's
// sums; with it |a|^2 is a . a bit for bit. Eight rows at once hide the latency of the chain of
// sums.
void SquaredNorms(const float* a, std::size_t rows, std::size_t dim, float* out) {
  constexpr std::size_t kRows = 8;
  for (std::size_t r0 = 0; r0 < rows; r0 += kRows) {
    const std::size_t count = rows - r0 < kRows ? rows - r0 : kRows;
    float sums[kRows] = {};
    for (std::size_t p = 0; p < dim; ++p) {
      for (std::size_t r = 0; r < count; ++r) {
        const float x = a[(r0 + r) * dim + p];
        sums[r] = kFused ? __builtin_fmaf(x, x, sums[r]) : sums[r] + x * x;
      }
    }
    for (std::size_t r = 0; r < count; ++r) out[r0 + r] = sums[r];
  }
}

PLIANT_INLINE void CountBits(const std::uint64_t* a, std::size_t rows, std::size_t words,
                             const std::uint64_t* b, std::size_t columns, float* out) {
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t j = 0; j < columns; ++j) {
      int bits = 0;
      for (std::size_t w = 0; w < words; ++w) {
        bits += __builtin_popcountll(a[r * words + w] ^ b[j * words + w]);
      }
      out[r * kPanel + j] = static_cast<float>(bits);
    }
  }
}

void HammingTile(const std::uint64_t* a, std::size_t rows, std::size_t words,
                 const std::uint64_t* b, std::size_t columns, float* out) {
  if (words == 4) {  // a loop of known length
    CountBits(a, rows, 4, b, columns, out);
  } else {
    CountBits(a, rows, words, b, columns, out);
  }
}

void DotsToSquared(float* __restrict values, std::size_t rows, const float* a2,
                   const float* __restrict b2) {
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t j = 0; j < kPanel; ++j) {
      // |a - b|^2 = |a|^2 + |b|^2 - 2 a.b makes a matrix product of the distances. Rounding can
      // take near ones a little below zero, never equal ones: see SquaredNorms.
      const float v = a2[r] + b2[j] - 2 * values[r * kPanel + j];
      values[r * kPanel + j] = v > 0 ? v : 0;
    }
  }
}

// Both updates use vectors. For the plain loop GCC jumps over the stores if no lane is better, and
// the processor cannot predict these jumps.
void UpdateRows(const float* values, std::size_t rows, std::uint32_t panel, RowState* states) {
  const Whole here = Whole{} + panel;
  for (std::size_t r = 0; r < rows; ++r) {
#pragma GCC unroll 8
    for (std::size_t j = 0; j < kPanel; j += kWidth) {
      const Vec v = Load(values + r * kPanel + j);
      const Vec old = Load(states[r].best + j);
      const Vec second = Load(states[r].second + j);
      auto* const index = reinterpret_cast<StoredWhole*>(states[r].panel + j);
      const Vec runner_up = v > old ? v : old;
      Store(runner_up < second ? runner_up : second, states[r].second + j);
      *index = v < old ? here : Whole(*index);
      Store(v < old ? v : old, states[r].best + j);
    }
  }
}

void UpdateColumns(const float* values, std::size_t rows, std::uint32_t row, float* best,
                   std::uint32_t* index) {
  for (std::size_t j = 0; j < kPanel; j += kWidth) {
    Vec nearest = Load(best + j);
    Whole found = *reinterpret_cast<const StoredWhole*>(index + j);
    for (std::size_t r = 0; r < rows; ++r) {
      const Vec v = Load(values + r * kPanel + j);
      const Whole here = Whole{} + static_cast<std::uint32_t>(row + r);
      found = v < nearest ? here : found;
      nearest = v < nearest ? v : nearest;
    }
    Store(nearest, best + j);
    *reinterpret_cast<StoredWhole*>(index + j) = found;
  }
}

}  // namespace

extern const Kernels kTable;
const Kernels kTable = {PLIANT_TEXT(PLIANT_KERNELS),
                        Tiles<kTileRows, false>,
                        Tiles<kTileRows, true>,
                        SquaredNorms,
                        HammingTile,
                        DotsToSquared,
                        UpdateRows,
                        UpdateColumns};

}  // namespace pliant::kernels::PLIANT_KERNELS
