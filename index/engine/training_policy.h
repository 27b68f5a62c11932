// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// When a collection gets a vocabulary automatically, and its default size.
#pragma once

#include <algorithm>
#include <cstdint>

#include "index/records/records.h"

namespace pliant {

// The default size of a vocabulary.

// Size of the training sample for a collection with this many descriptors, ten times the number of
// words. 4000 words up to four million descriptors; above, one word per 1000 descriptors, at most
// 262 144. So the words' lists keep their length as the collection grows, and ranking by neighbours
// its time. Smaller collections use all descriptors.
constexpr std::uint64_t DefaultVocabularySample(std::uint64_t descriptors) {
  return std::clamp<std::uint64_t>(descriptors / 100, 40'000, 2'621'440);
}

// An automatic vocabulary trained from at least this many descriptors is replaced only when the new
// one has kWordGrowth times as many words. Another one is replaced when the collection has kGrowth
// times as many descriptors as at its training.
inline constexpr std::uint64_t kFullSample = 40'000;
inline constexpr std::uint64_t kGrowth = 4;
inline constexpr std::uint64_t kWordGrowth = 2;

// True for a collection with images and no vocabulary, and for one that has outgrown its automatic
// vocabulary (CollectionRecord::automatic).
inline bool AutomaticTrainingIsDue(const CollectionRecord& record) {
  if (record.descriptors == 0) return false;
  if (!record.vocabulary) return true;
  const VocabularyOrigin& origin = record.vocabulary->origin;
  const bool outgrown =
      origin.sampled < kFullSample
          ? record.descriptors >= kGrowth * origin.available
          : DefaultVocabularySample(record.descriptors) >= kWordGrowth * origin.sampled;
  return record.automatic && outgrown;
}

}  // namespace pliant
