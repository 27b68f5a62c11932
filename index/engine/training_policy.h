// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// When a collection gets a vocabulary without being asked.
#pragma once

#include <cstdint>

#include "index/records/records.h"

namespace pliant {

// A vocabulary of ours that was chosen from at least this many descriptors is replaced only when it
// would have kWordGrowth times as many words; another one when there are kGrowth times as many
// descriptors as it was chosen from.
inline constexpr std::uint64_t kFullSample = 40'000;
inline constexpr std::uint64_t kGrowth = 4;
inline constexpr std::uint64_t kWordGrowth = 2;

// True for a collection with pictures and no vocabulary, and for one that has outgrown a vocabulary
// which nobody trained or chose by hand (CollectionRecord::automatic).
bool AutomaticTrainingIsDue(const CollectionRecord& record);

}  // namespace pliant
