// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/word_codec.h"

#include <limits>

#include "descriptor/base/error.h"
#include "index/store/blob_bytes.h"
#include "vocab/residual_codes.h"

namespace pliant {
namespace {

constexpr std::uint8_t kBowVersion = 1;
constexpr std::uint8_t kCodebookVersion = 1;

}  // namespace

std::vector<std::uint8_t> EncodeBow(const Bow& bow) {
  const std::size_t code_bytes = bow.total == 0 ? 0 : bow.codes.size() / bow.total;
  if (bow.codes.size() != code_bytes * bow.total || (code_bytes == 0) != (bow.total == 0)) {
    throw Error(ErrorCode::kInternal, "bow_codes",
                "a bag of words has more or fewer codes than descriptors");
  }
  std::vector<std::uint8_t> out;
  out.reserve(8 + 3 * bow.words.size() + bow.codes.size());
  out.push_back(kBowVersion);
  PutVarint(out, static_cast<std::uint32_t>(bow.words.size()));
  std::uint32_t next = 0;  // smallest word that may follow
  for (const WordCount& entry : bow.words) {
    if (entry.word < next || entry.count == 0) {
      throw Error(ErrorCode::kInternal, "bow_order", "a bag of words is not in ascending order");
    }
    PutVarint(out, entry.word - next);
    PutVarint(out, entry.count);
    next = entry.word + 1;
  }
  PutVarint(out, static_cast<std::uint32_t>(code_bytes));
  out.insert(out.end(), bow.codes.begin(), bow.codes.end());
  PutValue(out, Crc32(out));
  return out;
}

Bow DecodeBow(Bytes blob, std::size_t vocabulary_size) {
  const Bytes body = CheckedBody(blob, "words");
  if (body.empty() || body[0] != kBowVersion) {
    ThrowCorruptBlob("words are of an unknown format version");
  }
  std::size_t offset = 1;
  const std::uint32_t distinct = GetVarint(body, offset, "words");
  if (distinct > body.size() || distinct > vocabulary_size) ThrowCorruptBlob("words are too many");
  Bow bow;
  bow.words.reserve(distinct);
  std::uint64_t next = 0;
  std::uint64_t total = 0;
  for (std::uint32_t i = 0; i < distinct; ++i) {
    const std::uint64_t word = next + GetVarint(body, offset, "words");
    const std::uint32_t count = GetVarint(body, offset, "words");
    if (word >= vocabulary_size || count == 0) ThrowCorruptBlob("words are outside the vocabulary");
    bow.words.push_back({static_cast<std::uint32_t>(word), count});
    total += count;
    next = word + 1;
  }
  if (total > std::numeric_limits<std::uint32_t>::max()) ThrowCorruptBlob("words are too many");
  bow.total = static_cast<std::uint32_t>(total);
  const std::size_t code_bytes = GetVarint(body, offset, "words");
  if ((code_bytes == 0) != (bow.total == 0) || body.size() - offset != code_bytes * bow.total) {
    ThrowCorruptBlob("words have more or fewer codes than they need");
  }
  const auto codes = body.subspan(offset);
  bow.codes.assign(codes.begin(), codes.end());
  return bow;
}

std::vector<std::uint8_t> EncodeCodebook(const Codebook& codebook) {
  std::vector<std::uint8_t> out;
  out.push_back(kCodebookVersion);
  PutVarint(out, static_cast<std::uint32_t>(codebook.code_bytes));
  PutVarint(out, static_cast<std::uint32_t>(codebook.part_dim));
  for (const float value : codebook.rotation) PutValue(out, value);
  for (const float value : codebook.centroids) PutValue(out, value);
  PutValue(out, Crc32(out));
  return out;
}

Codebook DecodeCodebook(Bytes blob, const Descriptors& words) {
  const Bytes body = CheckedBody(blob, "codebooks");
  if (body.empty() || body[0] != kCodebookVersion) {
    ThrowCorruptBlob("codebooks are of an unknown format version");
  }
  std::size_t offset = 1;
  const std::uint32_t code_bytes = GetVarint(body, offset, "codebooks");
  const std::uint32_t part_dim = GetVarint(body, offset, "codebooks");
  if (code_bytes > kMaxDim || part_dim > kMaxDim)
    ThrowCorruptBlob("codebooks claim impossible sizes");
  Codebook codebook;
  codebook.code_bytes = static_cast<int>(code_bytes);
  codebook.part_dim = static_cast<int>(part_dim);
  const std::size_t rotation = codebook.padded_dim() * static_cast<std::size_t>(words.dim);
  const std::size_t centroids = codebook.padded_dim() * 16;
  const bool binary = words.kind == DescriptorKind::kBinary;
  if (body.size() - offset != (binary ? 0 : rotation + centroids) * sizeof(float)) {
    ThrowCorruptBlob("codebooks have another length than they say");
  }
  for (std::size_t i = 0; !binary && i < rotation + centroids; ++i, offset += sizeof(float)) {
    (i < rotation ? codebook.rotation : codebook.centroids)
        .push_back(GetValue<float>(body, offset));
  }
  if (codebook.empty()) ThrowCorruptBlob("codebooks are empty");
  try {
    CheckCodebook(codebook, words);
  } catch (const Error& error) {
    ThrowCorruptBlob(error.what());
  }
  return codebook;
}

}  // namespace pliant
