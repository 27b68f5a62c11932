// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The bytes of stored blobs: little-endian values, variable-length integers, and a checksum at the
// end. Private to index/store/.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "descriptor/image/image.h"

namespace pliant {

static_assert(std::endian::native == std::endian::little,
              "the blob formats are little-endian and written by memcpy");

inline constexpr std::size_t kChecksumBytes = 4;
inline constexpr std::uint32_t kMaxDim = 1u << 14;  // of what a blob may claim

// Throws kCorrupt: "stored " and `what`.
[[noreturn]] void ThrowCorruptBlob(const std::string& what);

// CRC-32 (IEEE 802.3, as in zlib and PNG), continued from `seed`.
std::uint32_t Crc32(Bytes bytes, std::uint32_t seed = 0);

template <typename T>
void PutValue(std::vector<std::uint8_t>& out, const T& value) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(&value);
  out.insert(out.end(), bytes, bytes + sizeof(T));
}

// The caller has checked that the bytes are there.
template <typename T>
T GetValue(Bytes bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof(T));
  return value;
}

void PutVarint(std::vector<std::uint8_t>& out, std::uint32_t value);

// Moves `offset` behind the integer. Throws kCorrupt when it is cut short or too large; `what`
// names the blob.
std::uint32_t GetVarint(Bytes bytes, std::size_t& offset, const char* what);

// The blob without the checksum at its end. Throws kCorrupt when that is another.
Bytes CheckedBody(Bytes blob, const char* what);

}  // namespace pliant
