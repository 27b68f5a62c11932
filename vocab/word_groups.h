// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The nearest words of a large vocabulary, coarse to fine: words lie in groups, and only the groups
// whose centres are nearest to a descriptor are looked into (the inverted file of J. Sivic and
// A. Zisserman, "Video Google", ICCV 2003, on words instead of images; in Faiss: IndexIVFFlat).
//
// Approximate: a word in a group that was not looked into is missed. vocab/README.md has the
// shares. Each distance depends on descriptor and word only, and of equally near words the lowest
// comes first, so the answer does not depend on what else is asked for or on threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "descriptor/match/distance.h"

namespace pliant {

struct NearWord {
  std::uint32_t word = 0;
  float distance = 0;  // Euclidean or Hamming
};

// Immutable and thread-safe.
class WordGroups {
 public:
  // Vocabularies of fewer words are searched exactly.
  static constexpr std::size_t kLeastWords = 8193;

  // About 2 sqrt(words) groups, by k-medoids of a part of the words. Deterministic. Takes about a
  // second for 65 536 words.
  explicit WordGroups(const Descriptors& words);

  // The nearest words of rows first, first + 1, ... of `descriptors`, row by row, nearest first;
  // `nearest` has `count` x `wanted` elements. `wanted` is at most the number of words.
  void FindNearest(const Descriptors& descriptors, std::size_t first, std::size_t count,
                   std::size_t wanted, NearWord* nearest) const;

 private:
  struct Group {
    std::vector<std::uint32_t> words;  // ascending
    PackedDescriptors packed;
  };

  // Of a descriptor with these distances from the centres: enough of the nearest for `wanted`
  // words.
  std::vector<std::uint32_t> NearestGroups(std::span<const float> distances,
                                           std::size_t wanted) const;

  PackedDescriptors centres_;
  std::vector<Group> groups_;
};

}  // namespace pliant
