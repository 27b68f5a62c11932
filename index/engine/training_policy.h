// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// When a collection gets a vocabulary without being asked.
#pragma once

#include <algorithm>
#include <cstdint>

#include "index/records/records.h"

namespace pliant {

// How large a vocabulary is when nobody says.

// Size of the training sample for a collection with this many descriptors, ten times the number of
// words: 4000 words up to four million descriptors, above a word for every 1000 descriptors, at
// most 65 536. The words' lists then keep their length while the collection grows, and ranking by
// neighbours its time. A smaller collection's sample is all it has.
constexpr std::uint64_t DefaultVocabularySample(std::uint64_t descriptors) {
  return std::clamp<std::uint64_t>(descriptors / 100, 40'000, 655'360);
}

// A vocabulary of ours that was chosen from at least this many descriptors is replaced only when it
// would have kWordGrowth times as many words; another one when there are kGrowth times as many
// descriptors as it was chosen from.
inline constexpr std::uint64_t kFullSample = 40'000;
inline constexpr std::uint64_t kGrowth = 4;
inline constexpr std::uint64_t kWordGrowth = 2;

// True for a collection with images and no vocabulary, and for one that has outgrown a vocabulary
// which nobody trained or chose by hand (CollectionRecord::automatic).
bool AutomaticTrainingIsDue(const CollectionRecord& record);

}  // namespace pliant
