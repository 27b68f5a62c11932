// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/tiff_directory.h"

#include <array>
#include <optional>
#include <utility>

#include "descriptor/image/byte_reader.h"

namespace pliant {
namespace {

enum Tag : std::uint16_t {
  kImageWidth = 256,
  kImageLength = 257,
  kStripOffsets = 273,
  kOrientation = 274,
  kStripByteCounts = 279,
  kTileOffsets = 324,
  kTileByteCounts = 325,
};

constexpr std::uint16_t kShort = 3;
constexpr std::uint16_t kLong = 4;
constexpr std::size_t kEntryBytes = 12;

// Bytes a value of TIFF 6.0's types 1 (BYTE) to 12 (DOUBLE).
constexpr std::array<std::uint8_t, 13> kTypeBytes = {0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8};

// Whether the entry and the values it points to lie within the file.
bool EntryComplete(const ByteReader& reader, std::size_t entry) {
  const auto type = reader.U16(entry + 2);
  const auto count = reader.U32(entry + 4);
  const auto offset = reader.U32(entry + 8);
  if (!type || !count || !offset) return false;
  const std::uint64_t size =
      std::uint64_t{*count} * (*type < kTypeBytes.size() ? kTypeBytes[*type] : 1);
  return size <= 4 || *offset + size <= reader.size();
}

// The values of one directory entry (SHORT or LONG); empty when they lie outside the file.
std::vector<std::uint32_t> EntryValues(const ByteReader& reader, std::size_t entry) {
  const auto type = reader.U16(entry + 2);
  const auto count = reader.U32(entry + 4);
  if (!type || !count || (*type != kShort && *type != kLong)) return {};
  const std::size_t width = *type == kShort ? 2 : 4;
  if (*count > reader.size() / width) return {};
  std::size_t at = entry + 8;
  if (*count * width > 4) {
    const auto offset = reader.U32(at);
    if (!offset) return {};
    at = *offset;
  }
  std::vector<std::uint32_t> values;
  values.reserve(*count);
  for (std::size_t i = 0; i < *count; ++i) {
    std::optional<std::uint32_t> value = reader.U32(at + i * width);
    if (width == 2) value = reader.U16(at + i * width);
    if (!value) return {};
    values.push_back(*value);
  }
  return values;
}

void ReadEntry(const ByteReader& reader, std::size_t entry, TiffDirectory& directory) {
  const auto tag = reader.U16(entry);
  if (!tag) return;
  std::vector<std::uint32_t> values = EntryValues(reader, entry);
  if (values.empty()) return;
  switch (*tag) {
    case kImageWidth:
      directory.width = values[0];
      break;
    case kImageLength:
      directory.height = values[0];
      break;
    case kOrientation:
      if (values[0] >= 1 && values[0] <= 8) directory.orientation = static_cast<int>(values[0]);
      break;
    case kStripOffsets:
    case kTileOffsets:
      directory.data_offsets = std::move(values);
      break;
    case kStripByteCounts:
    case kTileByteCounts:
      directory.data_bytes = std::move(values);
      break;
    default:
      break;
  }
}

}  // namespace

TiffDirectory ReadTiffDirectory(Bytes bytes) {
  TiffDirectory directory;
  const bool big_endian = ByteReader(bytes, false).StartsWith(0, "MM");
  const ByteReader reader(bytes, big_endian);
  const auto start = reader.U32(4);
  if (reader.U16(2) != std::uint16_t{42} || !start) return directory;
  const auto entries = reader.U16(*start);
  if (!entries) return directory;
  const std::size_t first = std::size_t{*start} + 2;
  directory.complete = reader.U32(first + *entries * kEntryBytes).has_value();
  for (std::size_t i = 0; i < *entries; ++i) {
    const std::size_t entry = first + i * kEntryBytes;
    ReadEntry(reader, entry, directory);
    directory.complete = directory.complete && EntryComplete(reader, entry);
  }
  return directory;
}

}  // namespace pliant
