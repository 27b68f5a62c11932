// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Finds equal descriptors. Internal to vocab/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "descriptor/features/features.h"

namespace pliant {

// The bytes of a row. Rows are equal when their bytes are.
std::string_view RowBytes(const Descriptors& descriptors, std::size_t row);

// `rows` without those equal to an earlier one, in the same order.
std::vector<std::uint32_t> DistinctRows(const Descriptors& descriptors,
                                        std::span<const std::uint32_t> rows);

}  // namespace pliant
