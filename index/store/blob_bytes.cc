// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/blob_bytes.h"

#include <limits>

#include <zlib.h>

#include "descriptor/base/error.h"

namespace pliant {

void ThrowCorruptBlob(const std::string& what) {
  throw Error(ErrorCode::kCorrupt, "blob_corrupt", "stored " + what);
}

std::uint32_t Crc32(Bytes bytes, std::uint32_t seed) {
  return static_cast<std::uint32_t>(::crc32_z(seed, bytes.data(), bytes.size()));
}

void PutVarint(std::vector<std::uint8_t>& out, std::uint32_t value) {
  for (; value >= 0x80; value >>= 7) out.push_back(static_cast<std::uint8_t>(value | 0x80));
  out.push_back(static_cast<std::uint8_t>(value));
}

std::uint32_t GetVarint(Bytes bytes, std::size_t& offset, const char* what) {
  std::uint64_t value = 0;
  for (int shift = 0; shift <= 28; shift += 7) {
    if (offset >= bytes.size()) ThrowCorruptBlob(std::string(what) + " are cut short");
    const std::uint8_t byte = bytes[offset++];
    value |= static_cast<std::uint64_t>(byte & 0x7f) << shift;
    if (byte < 0x80) {
      if (value > std::numeric_limits<std::uint32_t>::max()) break;
      return static_cast<std::uint32_t>(value);
    }
  }
  ThrowCorruptBlob(std::string(what) + " hold a number that is too large");
}

Bytes CheckedBody(Bytes blob, const char* what) {
  if (blob.size() < kChecksumBytes) ThrowCorruptBlob(std::string(what) + " are cut short");
  const Bytes body = blob.first(blob.size() - kChecksumBytes);
  if (GetValue<std::uint32_t>(blob, body.size()) != Crc32(body)) {
    ThrowCorruptBlob(std::string(what) + " do not match their checksum");
  }
  return body;
}

}  // namespace pliant
