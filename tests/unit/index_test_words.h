// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Words of images, made up for the tests of the inverted index and the ranking.
#pragma once

#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "index/rank/inverted_index.h"
#include "index/rank/ranking.h"

namespace pliant::testing {

// Of a vocabulary of bytes, whose codes are a byte each.
inline std::shared_ptr<const Quantizer> ByteQuantizer(std::size_t words) {
  auto vocabulary = std::make_shared<Vocabulary>();
  vocabulary->words = Descriptors::Binary(words, 1);
  vocabulary->codebook.code_bytes = 1;
  return std::make_shared<const Quantizer>(std::move(vocabulary));
}

// With a total and a code for each descriptor.
inline Bow Counted(std::vector<WordCount> words) {
  Bow bow;
  bow.words = std::move(words);
  for (const WordCount& entry : bow.words) {
    for (std::uint32_t i = 0; i < entry.count; ++i) {
      bow.codes.push_back(static_cast<std::uint8_t>(entry.word + 7 * ++bow.total));
    }
  }
  return bow;
}

inline Ranking RankByHistogram(const IndexSnapshot& snapshot, const Bow& query,
                               const RankOptions& options) {
  return Rank(snapshot, *ByteQuantizer(1), {.method = RankMethod::kHistogram, .bow = query},
              options);
}

// From counts, one a word.
inline Bow ToBow(const std::vector<double>& counts) {
  std::vector<WordCount> words;
  for (std::uint32_t w = 0; w < counts.size(); ++w) {
    if (counts[w] == 0) continue;
    words.push_back({w, static_cast<std::uint32_t>(counts[w])});
  }
  return Counted(std::move(words));
}

inline std::vector<double> RandomCounts(std::mt19937_64& random, std::size_t words,
                                        std::uint32_t keypoints) {
  std::vector<double> counts(words, 0);
  // Squaring makes low words frequent and high ones rare.
  for (std::uint32_t i = 0; i < keypoints; ++i) {
    const double u = static_cast<double>(random() >> 11) / 9007199254740992.0;
    counts[static_cast<std::size_t>(u * u * static_cast<double>(words))] += 1;
  }
  return counts;
}

inline IndexedImage MakeImage(std::int64_t key, std::vector<WordCount> words) {
  return {key, 0, "id" + std::to_string(key), Counted(std::move(words))};
}

}  // namespace pliant::testing
