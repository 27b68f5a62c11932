// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/match/distance_kernels.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "descriptor/base/error.h"

#define PLIANT_KERNEL_FILE "descriptor/match/distance_kernels.inl"
#define PLIANT_KERNEL_NAMESPACE pliant::kernels
#include "descriptor/base/kernel_sets.inl"

namespace pliant::kernels {
namespace {

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

void ScanForNearest(std::size_t first, std::size_t count, std::size_t rows, bool squared,
                    const FillTile& fill_tile, NearestTwo* nearest, NearestOne* nearest_query) {
  const Kernels& kernel = BestKernels();
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
