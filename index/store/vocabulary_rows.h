// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A vocabulary as stores keep it: a row for each word, and a checksum over all. Private to
// index/store/.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "descriptor/features/descriptor.h"
#include "descriptor/image/image.h"
#include "index/records/image_ref.h"
#include "vocab/vocabulary.h"

namespace pliant {

// The bytes of word i.
Bytes WordBytes(const Descriptors& words, std::size_t i);
// CRC-32 over the bytes of the words in order.
std::uint32_t VocabularyChecksum(const Vocabulary& vocabulary);

// What stands beside the words.
struct VocabularyHead {
  Key key = 0;
  std::int64_t words = 0;
  DescriptorKind kind = DescriptorKind::kFloat;
  std::int64_t dim = 0;
  std::string model_id;
  VocabularyOrigin origin;
  std::uint32_t checksum = 0;
};

// Puts a vocabulary together from its rows. Every function throws kCorrupt "vocabulary_corrupt"
// for what cannot belong to it.
class VocabularyRows {
 public:
  explicit VocabularyRows(const VocabularyHead& head);

  // In order, from word 0.
  void Add(std::int64_t word, Bytes data);
  // Once all words are there.
  std::shared_ptr<const Vocabulary> Finish(Bytes codebook);

  [[noreturn]] static void ThrowCorrupt(Key vocabulary, const std::string& what);

 private:
  VocabularyHead head_;
  std::shared_ptr<Vocabulary> vocabulary_;
  std::size_t added_ = 0;
};

}  // namespace pliant
