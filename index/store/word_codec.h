// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The compact, checked byte forms of bags of words and codebooks, as kept in the database. The
// formats are described byte by byte in index/FORMAT.md.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "descriptor/image/image.h"
#include "vocab/quantizer.h"

namespace pliant {

// Throws kInternal for a bag that is not in order or lacks a code for a descriptor.
std::vector<std::uint8_t> EncodeBow(const Bow& bow);

// Throws kCorrupt also for a word of `vocabulary_size` or more.
Bow DecodeBow(Bytes blob, std::size_t vocabulary_size);

// The words' codebook; DecodeCodebook throws kCorrupt for whatever does not fit `words`.
std::vector<std::uint8_t> EncodeCodebook(const Codebook& codebook);
Codebook DecodeCodebook(Bytes blob, const Descriptors& words);

}  // namespace pliant
