// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// First medoids for FasterPAM. Not for use outside vocab/.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "vocab/distance_rows.h"

namespace pliant {

// k distinct rows. Each is drawn with a chance proportional to its distance from the nearest one
// drawn before: k-means++ (Arthur and Vassilvitskii 2007) for a loss of plain distances. When all
// distances are 0 the lowest rows that are left fill up. O(k N). `checkpoint` as in DistanceRows.
std::vector<std::uint32_t> SeedMedoids(const DistanceRows& rows, std::size_t k, std::uint64_t seed,
                                       const std::function<void(double done)>& checkpoint);

}  // namespace pliant
