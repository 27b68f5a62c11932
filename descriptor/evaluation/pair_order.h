// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// In which order the pairs of a set are looked at. Internal to this room.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "descriptor/evaluation/dataset.h"

namespace pliant::evaluation {

struct PairCandidate {
  std::size_t scene = 0;
  ViewPair pair;
};

// In the set's own order.
std::vector<PairCandidate> AllPairs(const Dataset& dataset);

// Scene by scene in random order, a random pair each, then again with those that are left. Where
// the set does not say which picture comes first (neither sweep nor group), that is random, too.
std::vector<PairCandidate> ShufflePairs(const Dataset& dataset, std::uint64_t seed);

}  // namespace pliant::evaluation
