// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/match/stepped.h"

#include <cstring>
#include <limits>

#include "descriptor/match/distance_kernels.h"
#include "descriptor/match/nearest_scan.h"
#include "descriptor/match/step_kernels.h"

namespace pliant {
namespace {

using kernels::kPanel;
using kernels::kStepGroup;
using kernels::StepKernels;

constexpr int kMaxComponents = 1024;  // 127 * 127 times as many is a whole number of a float

}  // namespace

std::optional<SteppedDescriptors> SteppedDescriptors::Of(const Descriptors& descriptors) {
  if (StepKernels().empty() || descriptors.kind != DescriptorKind::kFloat || descriptors.dim < 1 ||
      descriptors.dim > kMaxComponents) {
    return std::nullopt;
  }
  SteppedDescriptors result;
  if (!result.Split(descriptors)) return std::nullopt;
  result.Transpose();
  return result;
}

bool SteppedDescriptors::Split(const Descriptors& descriptors) {
  const auto& kernel = StepKernels().back();
  const auto dim = static_cast<std::size_t>(descriptors.dim);
  dim_ = descriptors.dim;
  rows_ = descriptors.rows;
  groups_ = (dim + kStepGroup - 1) / kStepGroup;
  const std::size_t width = groups_ * kStepGroup;
  const std::size_t padded = (rows_ + kPanel - 1) / kPanel * kPanel;
  steps_.assign(rows_ * width, 0);
  scales_.assign(padded, 0);
  norms_.assign(padded, std::numeric_limits<float>::infinity());  // padding is never near anything
  sums_.assign(rows_, 0);
  for (std::size_t r = 0; r < rows_; ++r) {
    std::int8_t* row = steps_.data() + r * width;
    if (!kernel.split(descriptors.floats.data() + r * dim, dim, row, &scales_[r])) return false;
    std::int32_t sum = 0;
    std::int32_t squares = 0;
    for (std::size_t p = 0; p < width; ++p) {
      sum += row[p];
      squares += row[p] * row[p];
    }
    sums_[r] = sum;
    norms_[r] = scales_[r] * scales_[r] * static_cast<float>(squares);
  }
  return true;
}

void SteppedDescriptors::Transpose() {
  const std::size_t width = groups_ * kStepGroup;
  panels_.assign(scales_.size() * width, 0);
  for (std::size_t j = 0; j < rows_; ++j) {
    const std::int8_t* row = steps_.data() + j * width;
    std::int8_t* panel = panels_.data() + j / kPanel * kPanel * width + j % kPanel * kStepGroup;
    for (std::size_t g = 0; g < groups_; ++g) {
      std::memcpy(panel + g * kPanel * kStepGroup, row + g * kStepGroup, kStepGroup);
    }
  }
}

void SteppedDescriptors::FindNearest(const SteppedDescriptors& queries, std::size_t first,
                                     std::size_t count, NearestTwo* nearest,
                                     NearestOne* nearest_query) const {
  CheckQueries(queries.dim_ == dim_, queries.dim_, dim_, first, count, queries.rows_);
  const auto& kernel = StepKernels().back();
  const std::size_t width = groups_ * kStepGroup;
  const auto fill_tile = [&](std::size_t r0, std::size_t block, std::size_t j0, float* tile) {
    const std::size_t row = first + r0;
    kernel.squared_tile({queries.steps_.data() + row * width, queries.scales_.data() + row,
                         queries.sums_.data() + row, queries.norms_.data() + row},
                        block, groups_,
                        {panels_.data() + j0 * width, scales_.data() + j0, norms_.data() + j0},
                        tile);
  };
  ScanForNearest(first, count, rows_, true, fill_tile, nearest, nearest_query);
}

}  // namespace pliant
