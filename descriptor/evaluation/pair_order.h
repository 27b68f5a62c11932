// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The order in which the pairs of a set are measured. Internal to this folder.
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

// One random pair per scene, scenes in random order; then again with the remaining pairs. If the
// set does not define which image comes first (neither sweep nor group), that is random too.
std::vector<PairCandidate> ShufflePairs(const Dataset& dataset, std::uint64_t seed);

}  // namespace pliant::evaluation
