// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Inner loops of descriptor/match/distance.h, one set per instruction set. Internal.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "descriptor/match/distance.h"

namespace pliant::kernels {

inline constexpr std::size_t kPanel = 32;

// Running two smallest values of a row, kept apart for each column of a panel.
struct alignas(64) RowState {
  float best[kPanel];
  float second[kPanel];
  std::uint32_t panel[kPanel];  // of best
};

struct Kernels {
  const char* name;  // "avx512", "avx2", "baseline"
  // out[r * kPanel + j] = a_r . b_j for `rows` contiguous rows of `dim` floats and one panel.
  void (*dot_tile)(const float* a, std::size_t rows, std::size_t dim, const float* panel,
                   float* out);
  // The same with |a_r - b_j|^2.
  void (*squared_distance_tile)(const float* a, std::size_t rows, std::size_t dim,
                                const float* panel, float* out);
  // out[r] = |a_r|^2, summed as dot_tile sums.
  void (*squared_norms)(const float* a, std::size_t rows, std::size_t dim, float* out);
  // out[r * kPanel + j] = number of bits that differ, j < columns.
  void (*hamming_tile)(const std::uint64_t* a, std::size_t rows, std::size_t words,
                       const std::uint64_t* b, std::size_t columns, float* out);
  // values[r * kPanel + j] = max(0, a2[r] + b2[j] - 2 values[r * kPanel + j]).
  void (*dots_to_squared)(float* values, std::size_t rows, const float* a2, const float* b2);
  // Updates the states of `rows` rows with a tile of panel number `panel`.
  void (*update_rows)(const float* values, std::size_t rows, std::uint32_t panel, RowState* states);
  // Keeps the smallest value of each column and the row it came from (strictly smaller wins);
  // `row` is the number of the tile's first row.
  void (*update_columns)(const float* values, std::size_t rows, std::uint32_t row, float* best,
                         std::uint32_t* index);
};

// The kernel sets that this processor supports, best first.
const std::vector<const Kernels*>& UsableKernels();
inline const Kernels& BestKernels() { return *UsableKernels().front(); }

inline constexpr std::size_t kScanRows = 64;  // query rows a panel is kept in the cache for

// Writes a tile: the values of the query rows first + r0 .. + block - 1 (block <= kScanRows) and
// the panel that begins with packed row j0, infinity beyond the last.
using FillTile =
    std::function<void(std::size_t r0, std::size_t block, std::size_t j0, float* tile)>;

// The search that all layouts of descriptors share: the two nearest of `rows` packed rows for each
// of `count` query rows, of which the first has number `first`, and the nearest query row of each
// packed row if `nearest_query` is not null. With `squared` the values of the tiles are squared
// distances, and the roots of those found are taken.
void ScanForNearest(std::size_t first, std::size_t count, std::size_t rows, bool squared,
                    const FillTile& fill_tile, NearestTwo* nearest, NearestOne* nearest_query);

// Throws kConflict "descriptor_mismatch" unless `fit`, kInvalidArgument "rows_out_of_range" unless
// there are `count` rows from `first` among the `rows` of the queries.
void CheckQueries(bool fit, int query_dim, int dim, std::size_t first, std::size_t count,
                  std::size_t rows);

}  // namespace pliant::kernels
