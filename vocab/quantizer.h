// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Descriptors to visual words: exact nearest medoid by a blocked product,
//   argmin_w |x - w|^2 = argmin_w |x|^2 + |w|^2 - 2 x.w   (floats), or by counting bits (binary).
// Where rounding leaves the product undecided between words, their differences decide.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "descriptor/distance.h"
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
  // Throws kInvalidArgument for no vocabulary, one without words, or one that is malformed.
  explicit Quantizer(std::shared_ptr<const Vocabulary> vocabulary);

  const Vocabulary& vocabulary() const { return *vocabulary_; }

  // Nearest word of each row; of equally near words the lowest. Throws kConflict when kind or
  // dim differ from the vocabulary's, kInvalidArgument for values that are not finite. `threads`
  // 0 = all cores; the answer does not depend on it. O(rows x words x dim).
  std::vector<std::uint32_t> Assign(const Descriptors& descriptors, int threads = 1) const;

 private:
  void AssignBlock(const Descriptors& descriptors, std::size_t first, std::size_t count,
                   std::uint32_t* words) const;

  std::shared_ptr<const Vocabulary> vocabulary_;
  PackedDescriptors words_;
  double largest_squared_norm_ = 0;  // of a word; floats only
};

// Counts the words, in any order.
Bow MakeBow(std::vector<std::uint32_t> words);

}  // namespace pliant
