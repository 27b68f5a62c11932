// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Descriptors to visual words: exact nearest medoid by a blocked product.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "vocab/vocabulary.h"

namespace pliant {

struct WordCount {
  std::uint32_t word = 0;
  std::uint32_t count = 0;
  bool operator==(const WordCount&) const = default;
};

// Bag of visual words: words ascending, each once.
struct Bow {
  std::vector<WordCount> words;
  std::uint32_t total = 0;  // sum of the counts
};

// Immutable and thread-safe.
class Quantizer {
 public:
  explicit Quantizer(std::shared_ptr<const Vocabulary> vocabulary);

  const Vocabulary& vocabulary() const { return *vocabulary_; }

  // Nearest word of each row; of equally near words the lowest. Throws kConflict when kind or
  // dim differ from the vocabulary's. `threads` 0 = all cores.
  std::vector<std::uint32_t> Assign(const Descriptors& descriptors, int threads = 1) const;

 private:
  std::shared_ptr<const Vocabulary> vocabulary_;
  std::vector<float> half_squared_norms_;  // k; |w|^2 / 2 for floats
};

Bow MakeBow(std::vector<std::uint32_t> words);

}  // namespace pliant
