// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Stored blobs for the fuzz targets: inputs lack the checksum, which no mutation would find.
#pragma once

#include <cstring>
#include <vector>

#include "index/store/blob_codec.h"
#include "tests/fuzz/fuzz.h"

namespace pliant::fuzz {

inline std::vector<std::uint8_t> WithChecksum(Input body) {
  std::vector<std::uint8_t> blob = CopyOf(body);
  PutValue(blob, Crc32(body));
  return blob;
}

// Equal to the bit: NaN equals itself, and 0 differs from -0.
template <typename T>
bool SameBytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

}  // namespace pliant::fuzz
