// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The compact, checked byte forms of features, their words and codebooks, as kept in the
// database. index/FORMAT.md describes them byte by byte: little-endian values, variable-length
// integers, and a checksum at the end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "descriptor/features/coded_descriptors.h"
#include "descriptor/features/features.h"
#include "descriptor/image/image.h"
#include "vocab/vocabulary.h"

namespace pliant {

inline constexpr std::uint32_t kMaxDim = 1u << 14;  // largest valid value in a blob

// CRC-32 (IEEE 802.3, as in zlib and PNG), continued from `seed`.
std::uint32_t Crc32(Bytes bytes, std::uint32_t seed = 0);

template <typename T>
void PutValue(std::vector<std::uint8_t>& out, const T& value) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(&value);
  out.insert(out.end(), bytes, bytes + sizeof(T));
}

// Places are kept to 1/65 535 of the image's width and height (what lies outside moves to its
// edge), sizes to 1/4096 of an octave, angles to 1/256 of a turn, responses to 1/8 of an octave,
// and descriptors as in descriptor/features/coded_descriptors.h; octaves are not kept. Throws
// kInvalidArgument for values that are not finite, for descriptors that do not fit the keypoints,
// and for keypoints of an image without a size.
std::vector<std::uint8_t> EncodeFeatures(const Features& features);

// Throws kCorrupt for any error in the blob: magic, version, sizes, checksum. The model id is
// stored outside the blob: here it is empty.
Features DecodeFeatures(Bytes blob);
// Alone, as they lie in the blob.
CodedDescriptors DescriptorsIn(Bytes features);

// `features` as they are after storing and reading. Queries and new images are quantised in this
// precision, so that an image has the same words as a query and as a stored image. Keeps the model
// id. Throws what EncodeFeatures throws.
Features InStoredPrecision(Features features);

// The word of each descriptor. What an index knows of them besides, their codes, follows from the
// features (Quantizer::BowOf).
std::vector<std::uint8_t> EncodeWords(std::span<const std::uint32_t> words);

// Throws kCorrupt also for a word of `vocabulary_size` or more.
std::vector<std::uint32_t> DecodeWords(Bytes blob, std::size_t vocabulary_size);

// The words' codebook. DecodeCodebook throws kCorrupt if it does not fit `words`.
std::vector<std::uint8_t> EncodeCodebook(const Codebook& codebook);
Codebook DecodeCodebook(Bytes blob, const Descriptors& words);

// The bytes of word i.
Bytes WordBytes(const Descriptors& words, std::size_t i);
// CRC-32 over the bytes of the words in order.
std::uint32_t VocabularyChecksum(const Vocabulary& vocabulary);

}  // namespace pliant
