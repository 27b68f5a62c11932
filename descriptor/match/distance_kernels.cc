// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Each kernel is written once as an always-inlined template and instantiated inside functions
// that carry a target attribute: no file needs its own compiler flags, and no inline function of
// the standard library is ever compiled for a processor that may not be there.
#include "descriptor/match/distance_kernels.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "descriptor/base/error.h"

#define PLIANT_INLINE [[gnu::always_inline]] inline

namespace pliant::kernels {
namespace {

template <int kLanes>
struct Vec {
  using Type [[gnu::vector_size(kLanes * sizeof(float))]] = float;
  // The same in memory that holds plain floats, at any address.
  using Stored
      [[gnu::vector_size(kLanes * sizeof(float)), gnu::aligned(alignof(float)), gnu::may_alias]] =
          float;
  using Whole [[gnu::vector_size(kLanes * sizeof(std::uint32_t))]] = std::uint32_t;
  using StoredWhole [[gnu::vector_size(kLanes * sizeof(std::uint32_t)),
                      gnu::aligned(alignof(std::uint32_t)), gnu::may_alias]] = std::uint32_t;
};

// kRows x (kVectors * kLanes) sums at once in registers. Sums run over the components in order,
// so each value is the same whatever the tile.
template <int kLanes, int kVectors, int kRows, bool kDifference>
PLIANT_INLINE void Tile(const float* a, std::size_t dim, const float* panel, float* out) {
  using V = typename Vec<kLanes>::Type;
  using Stored = typename Vec<kLanes>::Stored;
  V sums[kRows][kVectors];
#pragma GCC unroll 8
  for (int r = 0; r < kRows; ++r) {
#pragma GCC unroll 4
    for (int v = 0; v < kVectors; ++v) sums[r][v] = V{};
  }
  for (std::size_t p = 0; p < dim; ++p) {
    V b[kVectors];
#pragma GCC unroll 4
    for (int v = 0; v < kVectors; ++v) {
      b[v] = *reinterpret_cast<const Stored*>(panel + p * kPanel + v * kLanes);
    }
#pragma GCC unroll 8
    for (int r = 0; r < kRows; ++r) {
      const float x = a[r * dim + p];
#pragma GCC unroll 4
      for (int v = 0; v < kVectors; ++v) {
        if constexpr (kDifference) {
          const V d = b[v] - x;
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
    for (int v = 0; v < kVectors; ++v) {
      *reinterpret_cast<Stored*>(out + r * kPanel + v * kLanes) = sums[r][v];
    }
  }
}

template <int kLanes, int kVectors, int kRows, bool kDifference>
PLIANT_INLINE void Tiles(const float* a, std::size_t rows, std::size_t dim, const float* panel,
                         float* out) {
  for (std::size_t c = 0; c < kPanel; c += kLanes * kVectors) {
    std::size_t r = 0;
    for (; r + kRows <= rows; r += kRows) {
      Tile<kLanes, kVectors, kRows, kDifference>(a + r * dim, dim, panel + c, out + r * kPanel + c);
    }
    for (; r < rows; ++r) {
      Tile<kLanes, kVectors, 1, kDifference>(a + r * dim, dim, panel + c, out + r * kPanel + c);
    }
  }
}

// kFused: the instruction set has fused multiply-add, into which the compiler contracts Tile's
// sums; with it |a|^2 is a . a bit for bit. Eight rows at once hide the latency of the chain of
// sums.
template <bool kFused>
PLIANT_INLINE void SquaredNorms(const float* a, std::size_t rows, std::size_t dim, float* out) {
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

PLIANT_INLINE void HammingTile(const std::uint64_t* a, std::size_t rows, std::size_t words,
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

PLIANT_INLINE void DotsToSquared(float* __restrict values, std::size_t rows, const float* a2,
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
template <int kLanes>
PLIANT_INLINE void UpdateRows(const float* values, std::size_t rows, std::uint32_t panel,
                              RowState* states) {
  using V = typename Vec<kLanes>::Type;
  using Stored = typename Vec<kLanes>::Stored;
  using Whole = typename Vec<kLanes>::Whole;
  using StoredWhole = typename Vec<kLanes>::StoredWhole;
  const Whole here = Whole{} + panel;
  for (std::size_t r = 0; r < rows; ++r) {
#pragma GCC unroll 8
    for (std::size_t j = 0; j < kPanel; j += kLanes) {
      const V v = *reinterpret_cast<const Stored*>(values + r * kPanel + j);
      Stored* best = reinterpret_cast<Stored*>(states[r].best + j);
      Stored* second = reinterpret_cast<Stored*>(states[r].second + j);
      StoredWhole* index = reinterpret_cast<StoredWhole*>(states[r].panel + j);
      const V old = *best;
      const V runner_up = v > old ? v : old;
      *second = runner_up < *second ? runner_up : V(*second);
      *index = v < old ? here : Whole(*index);
      *best = v < old ? v : old;
    }
  }
}

template <int kLanes>
PLIANT_INLINE void UpdateColumns(const float* values, std::size_t rows, std::uint32_t row,
                                 float* best, std::uint32_t* index) {
  using V = typename Vec<kLanes>::Type;
  using Stored = typename Vec<kLanes>::Stored;
  using Whole = typename Vec<kLanes>::Whole;
  using StoredWhole = typename Vec<kLanes>::StoredWhole;
  for (std::size_t j = 0; j < kPanel; j += kLanes) {
    V nearest = *reinterpret_cast<const Stored*>(best + j);
    Whole found = *reinterpret_cast<const StoredWhole*>(index + j);
    for (std::size_t r = 0; r < rows; ++r) {
      const V v = *reinterpret_cast<const Stored*>(values + r * kPanel + j);
      const Whole here = Whole{} + static_cast<std::uint32_t>(row + r);
      found = v < nearest ? here : found;
      nearest = v < nearest ? v : nearest;
    }
    *reinterpret_cast<Stored*>(best + j) = nearest;
    *reinterpret_cast<StoredWhole*>(index + j) = found;
  }
}

// One set of functions: NAME, the attribute, and the tile (lanes, vectors, rows) that fills the
// registers of the instruction set.
// NOLINTBEGIN(bugprone-macro-parentheses): TARGET is an attribute, which has no parentheses
#define PLIANT_KERNEL_SET(NAME, TARGET, FUSED, LANES, VECTORS, ROWS)                               \
  TARGET void DotTile##NAME(const float* a, std::size_t rows, std::size_t dim, const float* panel, \
                            float* out) {                                                          \
    Tiles<LANES, VECTORS, ROWS, false>(a, rows, dim, panel, out);                                  \
  }                                                                                                \
  TARGET void SquaredDistanceTile##NAME(const float* a, std::size_t rows, std::size_t dim,         \
                                        const float* panel, float* out) {                          \
    Tiles<LANES, VECTORS, ROWS, true>(a, rows, dim, panel, out);                                   \
  }                                                                                                \
  TARGET void SquaredNorms##NAME(const float* a, std::size_t rows, std::size_t dim, float* out) {  \
    SquaredNorms<FUSED>(a, rows, dim, out);                                                        \
  }                                                                                                \
  TARGET void HammingTile##NAME(const std::uint64_t* a, std::size_t rows, std::size_t words,       \
                                const std::uint64_t* b, std::size_t columns, float* out) {         \
    if (words == 4) {                                                                              \
      HammingTile(a, rows, 4, b, columns, out);                                                    \
    } else {                                                                                       \
      HammingTile(a, rows, words, b, columns, out);                                                \
    }                                                                                              \
  }                                                                                                \
  TARGET void DotsToSquared##NAME(float* values, std::size_t rows, const float* a2,                \
                                  const float* b2) {                                               \
    DotsToSquared(values, rows, a2, b2);                                                           \
  }                                                                                                \
  TARGET void UpdateRows##NAME(const float* values, std::size_t rows, std::uint32_t panel,         \
                               RowState* states) {                                                 \
    UpdateRows<LANES>(values, rows, panel, states);                                                \
  }                                                                                                \
  TARGET void UpdateColumns##NAME(const float* values, std::size_t rows, std::uint32_t row,        \
                                  float* best, std::uint32_t* index) {                             \
    UpdateColumns<LANES>(values, rows, row, best, index);                                          \
  }                                                                                                \
  constexpr KernelSet k##NAME = {#NAME,                                                            \
                                 DotTile##NAME,                                                    \
                                 SquaredDistanceTile##NAME,                                        \
                                 SquaredNorms##NAME,                                               \
                                 HammingTile##NAME,                                                \
                                 DotsToSquared##NAME,                                              \
                                 UpdateRows##NAME,                                                 \
                                 UpdateColumns##NAME};
// NOLINTEND(bugprone-macro-parentheses)

#define PLIANT_NO_TARGET
PLIANT_KERNEL_SET(Portable, PLIANT_NO_TARGET, false, 4, 2, 4)
#if defined(__x86_64__)
PLIANT_KERNEL_SET(Avx2, [[gnu::target("avx2,fma,popcnt")]], true, 8, 4, 2)
PLIANT_KERNEL_SET(Avx512, [[gnu::target("avx512f,avx512vl,avx512bw,avx512dq,fma,popcnt")]], true,
                  16, 2, 8)
#endif

const KernelSet& Choose() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  const bool popcnt = __builtin_cpu_supports("popcnt");
  if (popcnt && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq")) {
    return kAvx512;
  }
  if (popcnt && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return kAvx2;
#endif
  return kPortable;
}

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Every lane at the start, before a value was seen.
void StartState(RowState* state, std::size_t rows) {
  for (std::size_t r = 0; r < rows; ++r) {
    std::fill_n(state[r].best, kPanel, kInfinity);
    std::fill_n(state[r].second, kPanel, kInfinity);
    std::fill_n(state[r].panel, kPanel, 0U);
  }
}

// Joins the columns of a row's state. Of equal values the lowest index wins. The second nearest of
// all is the nearest of its own column or the second there, so two values a column are enough.
NearestTwo Finish(const RowState& state) {
  NearestTwo result{0, kInfinity, kInfinity};
  for (std::size_t j = 0; j < kPanel; ++j) {
    const float v = state.best[j];
    const auto index = static_cast<std::uint32_t>(state.panel[j] * kPanel + j);
    if (v < result.distance || (v == result.distance && v < kInfinity && index < result.index)) {
      result.second = std::min(result.distance, state.second[j]);
      result.distance = v;
      result.index = index;
    } else {
      result.second = std::min(result.second, v);
    }
  }
  return result;
}

}  // namespace

const KernelSet& Kernels() {
  static const KernelSet& chosen = Choose();
  return chosen;
}

void ScanForNearest(std::size_t first, std::size_t count, std::size_t rows, bool squared,
                    const FillTile& fill_tile, NearestTwo* nearest, NearestOne* nearest_query) {
  const auto& kernel = Kernels();
  const std::size_t padded = (rows + kPanel - 1) / kPanel * kPanel;
  std::vector<float> column_best(nearest_query != nullptr ? padded : 0, kInfinity);
  std::vector<std::uint32_t> column_index(column_best.size(), 0);
  std::vector<RowState> state(std::min(kScanRows, count));
  alignas(64) float tile[kScanRows * kPanel];
  for (std::size_t r0 = 0; r0 < count; r0 += kScanRows) {
    const std::size_t block = std::min(kScanRows, count - r0);
    StartState(state.data(), block);
    for (std::size_t j0 = 0; j0 < rows; j0 += kPanel) {
      fill_tile(r0, block, j0, tile);
      kernel.update_rows(tile, block, static_cast<std::uint32_t>(j0 / kPanel), state.data());
      if (nearest_query == nullptr) continue;
      kernel.update_columns(tile, block, static_cast<std::uint32_t>(first + r0),
                            column_best.data() + j0, column_index.data() + j0);
    }
    for (std::size_t r = 0; r < block; ++r) nearest[r0 + r] = Finish(state[r]);
  }
  const auto distance = [&](float v) { return squared ? std::sqrt(v) : v; };
  for (std::size_t r = 0; r < count; ++r) {
    nearest[r].distance = distance(nearest[r].distance);
    nearest[r].second = distance(nearest[r].second);
  }
  if (nearest_query == nullptr) return;
  for (std::size_t j = 0; j < rows; ++j) {
    nearest_query[j] = {column_index[j], distance(column_best[j])};
  }
}

void CheckQueries(bool fit, int query_dim, int dim, std::size_t first, std::size_t count,
                  std::size_t rows) {
  if (!fit) {
    throw Error(ErrorCode::kConflict, "descriptor_mismatch",
                "Descriptors of " + std::to_string(query_dim) + " and " + std::to_string(dim) +
                    " components, or of different kinds, cannot be compared.");
  }
  if (first > rows || count > rows - first) {
    throw Error(ErrorCode::kInvalidArgument, "rows_out_of_range",
                "Rows " + std::to_string(first) + " to " + std::to_string(first + count) +
                    " are beyond the " + std::to_string(rows) + " there are.");
  }
}

}  // namespace pliant::kernels
