// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The inner loop of ranking. Private to index/.
#pragma once

#include <cstdint>
#include <span>

namespace pliant {

// sums[i] += weight * counts[i]. Product and sum are rounded one after the other on every
// processor, so that results do not depend on it.
void AccumulateDense(std::span<const std::uint8_t> counts, float weight, float* sums);

}  // namespace pliant
