// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Initial medoids for FasterPAM. Internal to vocab/.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "vocab/distance_rows.h"

namespace pliant {

// k distinct rows. Each is drawn with a probability proportional to its distance from the nearest
// row drawn before: k-means++ (Arthur and Vassilvitskii 2007) for a loss of plain distances. When
// all distances are 0, the lowest remaining rows are used. O(k N). `checkpoint` as in DistanceRows.
std::vector<std::uint32_t> SeedMedoids(const DistanceRows& rows, std::size_t k, std::uint64_t seed,
                                       const std::function<void(double done)>& checkpoint);

}  // namespace pliant
