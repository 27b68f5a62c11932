// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Parts of a blob that are compressed by zlib: their length in 4 bytes, then the stream. Private to
// store/. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "descriptor/image/image.h"

namespace pliant {

enum class Compression {
  kRepeats,     // looks for what came before
  kValuesOnly,  // only gives frequent bytes shorter codes (Huffman): for noise, fast
};

void PutCompressed(Bytes plain, Compression compression, std::vector<std::uint8_t>* out);

// The part at `*offset`, which must have `size` bytes when decompressed; moves the offset behind
// it. Throws kCorrupt "blob_corrupt", before it allocates what the part cannot hold.
std::vector<std::uint8_t> GetCompressed(Bytes bytes, std::size_t* offset, std::size_t size);

}  // namespace pliant
