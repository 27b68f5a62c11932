// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Words of pictures, made up for the tests of the inverted index and the ranking.
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "index/rank/inverted_index.h"

namespace pliant::testing {

// From counts, one a word.
inline Bow ToBow(const std::vector<double>& counts) {
  Bow bow;
  for (std::uint32_t w = 0; w < counts.size(); ++w) {
    if (counts[w] == 0) continue;
    bow.words.push_back({w, static_cast<std::uint32_t>(counts[w])});
    bow.total += static_cast<std::uint32_t>(counts[w]);
  }
  return bow;
}

inline std::vector<double> RandomCounts(std::mt19937_64& random, std::size_t words,
                                        std::uint32_t keypoints) {
  std::vector<double> counts(words, 0);
  // Squaring makes low words frequent and high ones rare, so that both kinds of list are used.
  for (std::uint32_t i = 0; i < keypoints; ++i) {
    const double u = static_cast<double>(random() >> 11) / 9007199254740992.0;
    counts[static_cast<std::size_t>(u * u * static_cast<double>(words))] += 1;
  }
  return counts;
}

inline IndexedPicture Picture(std::int64_t key, std::vector<WordCount> words) {
  IndexedPicture picture{key, 0, "id" + std::to_string(key), {}};
  picture.bow.words = std::move(words);
  for (const WordCount& entry : picture.bow.words) picture.bow.total += entry.count;
  return picture;
}

}  // namespace pliant::testing
