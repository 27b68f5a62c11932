// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How large a vocabulary is when nobody says.
#pragma once

#include <algorithm>
#include <cstdint>

namespace pliant {

// Size of the training sample for a collection with this many descriptors, ten times the number of
// words: 4000 words up to four million descriptors, above a word for every 1000 descriptors, at
// most 65 536. The words' lists then keep their length while the collection grows, and ranking by
// neighbours its time. A smaller collection's sample is all it has.
constexpr std::uint64_t DefaultVocabularySample(std::uint64_t descriptors) {
  return std::clamp<std::uint64_t>(descriptors / 100, 40'000, 655'360);
}

}  // namespace pliant
