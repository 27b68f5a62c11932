// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/distinct_rows.h"

#include <unordered_set>

namespace pliant {

std::string_view RowBytes(const Descriptors& d, std::size_t row) {
  if (d.kind == DescriptorKind::kFloat) {
    return {reinterpret_cast<const char*>(d.float_row(row).data()), d.dim * sizeof(float)};
  }
  return {reinterpret_cast<const char*>(d.binary_row(row).data()), static_cast<std::size_t>(d.dim)};
}

std::vector<std::uint32_t> DistinctRows(const Descriptors& descriptors,
                                        std::span<const std::uint32_t> rows) {
  std::unordered_set<std::string_view> seen;
  seen.reserve(rows.size());
  std::vector<std::uint32_t> kept;
  for (const std::uint32_t row : rows) {
    if (seen.insert(RowBytes(descriptors, row)).second) kept.push_back(row);
  }
  return kept;
}

}  // namespace pliant
