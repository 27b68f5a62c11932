// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/exif.h"

#include "descriptor/image/byte_reader.h"

namespace pliant {

int ReadOrientation(Bytes exif) {
  constexpr std::uint16_t kOrientation = 0x0112;
  constexpr std::uint16_t kShort = 3;
  constexpr std::uint16_t kLong = 4;
  constexpr std::size_t kEntryBytes = 12;  // tag, type, count, value
  const ByteReader reader(exif, ByteReader(exif, false).StartsWith(0, "MM"));
  if (reader.U16(2) != std::uint16_t{42}) return 1;
  const std::size_t directory = reader.U32(4).value_or(0);
  const std::size_t entries = reader.U16(directory).value_or(0);
  for (std::size_t i = 0; i < entries; ++i) {
    const std::size_t entry = directory + 2 + i * kEntryBytes;
    if (reader.U16(entry) != kOrientation) continue;
    if (reader.U32(entry + 4) != 1U) return 1;
    const std::uint16_t type = reader.U16(entry + 2).value_or(0);
    const std::uint32_t value = type == kShort  ? reader.U16(entry + 8).value_or(0)
                                : type == kLong ? reader.U32(entry + 8).value_or(0)
                                                : 1;
    return value >= 1 && value <= 8 ? static_cast<int>(value) : 1;
  }
  return 1;
}

}  // namespace pliant
