// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The search for nearest neighbours that all layouts of descriptors share. Internal.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "descriptor/match/distance.h"
#include "descriptor/match/distance_kernels.h"

namespace pliant {

inline constexpr std::size_t kScanRows = 64;  // query rows a panel is kept in the cache for

// Every lane at the start, before a value was seen.
void StartState(kernels::RowState* state, std::size_t rows);

// Joins the columns of a row's state. Of equal values the lowest index wins.
NearestTwo Finish(const kernels::RowState& state);

// The two nearest of `rows` packed rows for each of `count` query rows, of which the first has
// number `first`, and the nearest query row of each packed row if `nearest_query` is not null.
// `fill_tile(r0, block, j0, tile)` writes the values of the query rows first + r0 .. + block - 1
// (block <= kScanRows) and the panel that begins with packed row j0, infinity beyond the last. With
// `squared` the values are squared distances, and the roots of those found are taken.
template <typename FillTile>
void ScanForNearest(std::size_t first, std::size_t count, std::size_t rows, bool squared,
                    const FillTile& fill_tile, NearestTwo* nearest, NearestOne* nearest_query) {
  constexpr std::size_t kPanel = kernels::kPanel;
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const auto& kernel = kernels::Kernels();
  const std::size_t padded = (rows + kPanel - 1) / kPanel * kPanel;
  std::vector<float> column_best(nearest_query != nullptr ? padded : 0, kInfinity);
  std::vector<std::uint32_t> column_index(column_best.size(), 0);
  std::vector<kernels::RowState> state(std::min(kScanRows, count));
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

// Throws kConflict "descriptor_mismatch" unless `fit`, kInvalidArgument "rows_out_of_range" unless
// there are `count` rows from `first` among the `rows` of the queries.
void CheckQueries(bool fit, int query_dim, int dim, std::size_t first, std::size_t count,
                  std::size_t rows);

}  // namespace pliant
