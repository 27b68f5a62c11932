// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Equal descriptors. Not for use outside vocab/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "descriptor/features/features.h"

namespace pliant {

// The bytes of a row. Two rows are the same word when their bytes are.
std::string_view RowBytes(const Descriptors& descriptors, std::size_t row);

// The rows without those equal to an earlier one, in the same order.
std::vector<std::uint32_t> DistinctRows(const Descriptors& descriptors,
                                        std::span<const std::uint32_t> rows);

}  // namespace pliant
