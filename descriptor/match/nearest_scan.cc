// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/match/nearest_scan.h"

#include <string>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

using kernels::kPanel;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

}  // namespace

void StartState(kernels::RowState* state, std::size_t rows) {
  for (std::size_t r = 0; r < rows; ++r) {
    std::fill_n(state[r].best, kPanel, kInfinity);
    std::fill_n(state[r].second, kPanel, kInfinity);
    std::fill_n(state[r].panel, kPanel, 0U);
  }
}

// The second nearest of all is the nearest of its own column or the second there, so two values a
// column are enough.
NearestTwo Finish(const kernels::RowState& state) {
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

}  // namespace pliant
