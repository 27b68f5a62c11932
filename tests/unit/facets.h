// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Reading facets in tests.
#pragma once

#include <cstdint>

#include "index/records/listing.h"

namespace pliant::testing {

inline std::uint64_t CountOf(const Facet& facet, const FilterValue& value) {
  for (const Facet::Value& one : facet.values) {
    if (one.value == value) return one.count;
  }
  return 0;
}

}  // namespace pliant::testing
