// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Brute-force matching of two sets of descriptors.
#pragma once

#include <cstdint>
#include <vector>

#include "descriptor/features/features.h"
#include "descriptor/match/distance.h"

namespace pliant {

// A reference descriptor and its nearest neighbour in the query.
struct Match {
  std::uint32_t query = 0;
  std::uint32_t reference = 0;
  float distance = 0;   // Euclidean or Hamming
  float ratio = 0;      // distance / distance to the second nearest (Lowe 2004); 1 when both are 0,
                        // 0 when there is no second
  bool mutual = false;  // the query descriptor's nearest neighbour is this reference descriptor
};

struct MatchOptions {
  float max_ratio = 1;       // matches above it are discarded; 1 = keep all
  bool mutual_only = false;  // discard matches that are not mutual
  int threads = 1;           // 0 = all cores; the result does not depend on it
};

// Matches every reference descriptor, in order of reference. The query is packed once, and many
// references can be matched with it. Throws kConflict "descriptor_mismatch" if kind or dim differ,
// kInvalidArgument for options out of range. Values must be finite. Thread-safe.
std::vector<Match> MatchDescriptors(const PackedDescriptors& query, const Descriptors& reference,
                                    const MatchOptions& options = {});

}  // namespace pliant
