// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Assigns descriptors to visual words: exact nearest medoid by a blocked product,
//   argmin_w |x - w|^2 = argmin_w |x|^2 + |w|^2 - 2 x.w   (floats), or by counting bits (binary).
// If rounding errors make the product ambiguous, summed differences decide.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "descriptor/match/distance.h"
#include "vocab/vocabulary.h"

namespace pliant {

struct CodedDescriptors;
class ResidualCoder;

struct WordCount {
  std::uint32_t word = 0;
  std::uint32_t count = 0;
  bool operator==(const WordCount&) const = default;
};

// Bag of visual words: words ascending, each once.
struct Bow {
  std::vector<WordCount> words;
  std::uint32_t total = 0;  // sum of the counts
  // The code of each descriptor (vocab/residual_codes.h), in order of its word: `count` codes for
  // each word. Empty if the vocabulary has no codebook.
  std::vector<std::uint8_t> codes;
  std::vector<std::int16_t> biases;  // of the codes; empty for binary descriptors
};

struct NearWord {
  std::uint32_t word = 0;
  float distance = 0;  // Euclidean or Hamming
};

// The nearest words of a large vocabulary, from coarse to fine. Words form groups, and only the
// groups whose centres are nearest to a descriptor are searched (the inverted file of J. Sivic and
// A. Zisserman, "Video Google", ICCV 2003, on words instead of images; in Faiss: IndexIVFFlat).
//
// Approximate: a word in a group that is not searched is missed. vocab/README.md has the shares.
// Each distance depends on descriptor and word only. Of equally near words the lowest comes first.
// So the result does not depend on other rows or on threads. Immutable and thread-safe.
class WordGroups {
 public:
  // Vocabularies of fewer words are searched exactly.
  static constexpr std::size_t kLeastWords = 8193;

  // About 2 sqrt(words) groups, by k-medoids of a part of the words. Deterministic, on all
  // cores.
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

  // The nearest groups of a descriptor with these distances to the centres, enough for `wanted`
  // words.
  std::vector<std::uint32_t> NearestGroups(std::span<const float> distances,
                                           std::size_t wanted) const;

  PackedDescriptors centres_;
  std::vector<Group> groups_;
};

// Immutable and thread-safe.
class Quantizer {
 public:
  // Throws kInvalidArgument for a null, empty or malformed vocabulary.
  explicit Quantizer(std::shared_ptr<const Vocabulary> vocabulary);
  ~Quantizer();

  const Vocabulary& vocabulary() const { return *vocabulary_; }

  // Nearest word of each row; ties go to the lowest. Throws kConflict when kind or
  // dim differ from the vocabulary's, kInvalidArgument for values that are not finite. `threads`
  // 0 = all cores; the result does not depend on it. O(rows x words x dim).
  std::vector<std::uint32_t> Assign(const Descriptors& descriptors, int threads = 1) const;

  // The `count` nearest words of each row (fewer when there are fewer words), nearest first, row by
  // row: rows x min(count, words). Throws as Assign does, and kInvalidArgument for count < 1.
  std::vector<NearWord> NearestWords(const Descriptors& descriptors, int count,
                                     int threads = 1) const;

  // nullptr for a vocabulary without codebook.
  const ResidualCoder* coder() const { return coder_.get(); }

  // The bag of words of the descriptors, given the word of each. With codes when the vocabulary has
  // a codebook.
  Bow BowOf(const CodedDescriptors& descriptors, std::span<const std::uint32_t> words) const;

 private:
  void CheckFits(const Descriptors& descriptors) const;
  void AssignBlock(const Descriptors& descriptors, std::size_t first, std::size_t count,
                   std::uint32_t* words) const;

  std::shared_ptr<const Vocabulary> vocabulary_;
  PackedDescriptors words_;
  std::unique_ptr<const WordGroups> groups_;  // large vocabularies only
  std::unique_ptr<const ResidualCoder> coder_;
  double largest_squared_norm_ = 0;  // of a word; floats only
};

// Counts words given in any order; no codes.
Bow MakeBow(std::vector<std::uint32_t> words);

}  // namespace pliant
