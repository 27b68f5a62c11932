// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/vocabulary_rows.h"

#include <cstring>
#include <utility>

#include "descriptor/base/error.h"
#include "index/store/blob_bytes.h"
#include "index/store/word_codec.h"

namespace pliant {
namespace {

constexpr std::int64_t kMostComponents = 1 << 14;  // of a descriptor

}  // namespace

Bytes WordBytes(const Descriptors& words, std::size_t i) {
  if (words.kind == DescriptorKind::kBinary) return words.binary_row(i);
  const std::span<const float> row = words.float_row(i);
  return {reinterpret_cast<const std::uint8_t*>(row.data()), row.size_bytes()};
}

std::uint32_t VocabularyChecksum(const Vocabulary& vocabulary) {
  std::uint32_t crc = 0;
  for (std::size_t i = 0; i < vocabulary.size(); ++i) {
    crc = Crc32(WordBytes(vocabulary.words, i), crc);
  }
  return crc;
}

void VocabularyRows::ThrowCorrupt(Key vocabulary, const std::string& what) {
  throw Error(ErrorCode::kCorrupt, "vocabulary_corrupt",
              "vocabulary " + std::to_string(vocabulary) + " " + what + "; train a new one");
}

VocabularyRows::VocabularyRows(const VocabularyHead& head)
    : head_(head), vocabulary_(std::make_shared<Vocabulary>()) {
  if (head.words < 1 || head.words > static_cast<std::int64_t>(kMaxWords) || head.dim < 1 ||
      head.dim > kMostComponents) {
    ThrowCorrupt(head.key, "claims an impossible size");
  }
  const auto rows = static_cast<std::size_t>(head.words);
  const int dim = static_cast<int>(head.dim);
  vocabulary_->words = head.kind == DescriptorKind::kFloat ? Descriptors::Float(rows, dim)
                                                           : Descriptors::Binary(rows, dim);
  vocabulary_->model_id = head.model_id;
  vocabulary_->origin = head.origin;
}

void VocabularyRows::Add(std::int64_t word, Bytes data) {
  if (added_ >= vocabulary_->size() || word != static_cast<std::int64_t>(added_)) {
    ThrowCorrupt(head_.key, "has a gap");
  }
  const Bytes target = WordBytes(vocabulary_->words, added_++);
  if (data.size() != target.size()) ThrowCorrupt(head_.key, "has a word of the wrong size");
  std::memcpy(const_cast<std::uint8_t*>(target.data()), data.data(), data.size());
}

std::shared_ptr<const Vocabulary> VocabularyRows::Finish(Bytes codebook) {
  Vocabulary& vocabulary = *vocabulary_;
  if (added_ != vocabulary.size()) ThrowCorrupt(head_.key, "has lost words");
  vocabulary.codebook = DecodeCodebook(codebook, vocabulary.words);
  if (VocabularyChecksum(vocabulary) != head_.checksum) {
    ThrowCorrupt(head_.key, "does not match its checksum");
  }
  return std::exchange(vocabulary_, nullptr);
}

}  // namespace pliant
