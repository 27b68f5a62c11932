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

// Postings of one word with their signatures; weights of 65 numbers of differing bits.
struct SignedPostings {
  const std::uint64_t* signatures = nullptr;
  std::uint64_t signature = 0;     // of the query
  const float* weights = nullptr;  // 65
};

// sums[pictures[i]] += weights[bits in which signatures[i] differs], i = 0..n-1.
void AccumulateAlike(const SignedPostings& postings, const std::uint16_t* pictures, std::size_t n,
                     float* sums);
// The same for the pictures p = 0..n-1 with counts[p] > 0, which have one signature each, in order.
void AccumulateAlikeDense(const SignedPostings& postings, const std::uint8_t* counts, std::size_t n,
                          float* sums);

}  // namespace pliant
