// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// WebP (RFC 9649): a RIFF container of VP8, VP8L or VP8X chunks.
#include <algorithm>
#include <array>

#include "descriptor/image/byte_reader.h"
#include "descriptor/image/image_header.h"
#include "descriptor/image/tiff_directory.h"

namespace pliant {
namespace {

constexpr std::size_t kFileHeaderBytes = 12;
constexpr std::size_t kChunkHeaderBytes = 8;

// Calls visit(chunk offset, chunk) with header and padding for each chunk; cuts the last one off at
// the end of the file.
template <typename Visit>
void WalkWebp(Bytes bytes, Visit visit) {
  const ByteReader reader(bytes, false);
  std::size_t at = kFileHeaderBytes;
  while (const auto length = reader.U32(at + 4)) {
    const std::size_t size = kChunkHeaderBytes + std::size_t{*length} + (*length & 1);
    visit(at, bytes.subspan(at, std::min(size, bytes.size() - at)));
    at += size;
  }
}

bool IsMetadata(const ByteReader& reader, std::size_t chunk) {
  constexpr std::array kTypes = {"EXIF", "XMP ", "ICCP"};
  return std::any_of(kTypes.begin(), kTypes.end(),
                     [&](const char* name) { return reader.StartsWith(chunk, name); });
}

void ReadWebpCanvas(const ByteReader& file, std::size_t data, ImageHeader& header) {
  const ByteReader reader(file.From(data), false);
  const auto u24 = [&](std::size_t at) {
    return std::int64_t{reader.U16(at).value_or(0)} +
           (std::int64_t{reader.U8(at + 2).value_or(0)} << 16);
  };
  if (file.StartsWith(data - 8, "VP8X")) {
    header.width = u24(4) + 1;
    header.height = u24(7) + 1;
  } else if (file.StartsWith(data - 8, "VP8L")) {
    const std::uint32_t bits = reader.U32(1).value_or(0);
    header.width = (bits & 0x3FFF) + 1;
    header.height = ((bits >> 14) & 0x3FFF) + 1;
  } else if (file.StartsWith(data - 8, "VP8 ")) {
    header.width = reader.U16(6).value_or(0) & 0x3FFF;
    header.height = reader.U16(8).value_or(0) & 0x3FFF;
  }
}

// Of the first chunk: what it says of the picture must be its own, not the next chunk's, which may
// be metadata and be dropped.
std::uint32_t LeastBytes(const ByteReader& file, std::size_t chunk) {
  constexpr std::uint32_t kCanvas = 10;
  constexpr std::uint32_t kLossless = 5;
  constexpr std::uint32_t kLossy = 10;
  if (file.StartsWith(chunk, "VP8X")) return kCanvas;
  return file.StartsWith(chunk, "VP8L") ? kLossless : kLossy;
}

}  // namespace

ScannedImage ScanWebp(Bytes bytes) {
  // The decoder's own copy in four channels, its result, and that without transparency.
  constexpr int kPixelBytes = 4 + 4 + 3;
  ScannedImage scanned{.header = {.format = ImageFormat::kWebp}, .pixel_bytes = kPixelBytes};
  ImageHeader& header = scanned.header;
  const ByteReader reader(bytes, false);
  scanned.complete = std::uint64_t{reader.U32(4).value_or(0)} + 8 <= bytes.size();
  bool exif = false;
  WalkWebp(bytes, [&](std::size_t at, Bytes chunk) {
    // Of the first chunk alone: where that is another one, libwebp takes its name and what follows
    // for a picture without container, of any size.
    if (at == kFileHeaderBytes) ReadWebpCanvas(reader, at + kChunkHeaderBytes, header);
    if (exif || !reader.StartsWith(at, "EXIF")) return;
    const std::size_t skip = reader.StartsWith(at + kChunkHeaderBytes, "Exif") ? 6 : 0;
    header.exif_orientation =
        ReadOrientation(ByteReader(chunk, false).From(kChunkHeaderBytes + skip));
    exif = true;
  });
  const bool has_first_chunk = bytes.size() >= kFileHeaderBytes + kChunkHeaderBytes;
  if (has_first_chunk && !reader.StartsWith(kFileHeaderBytes, "VP8")) {
    scanned.defect = "its first chunk is no picture";
  } else if (has_first_chunk &&
             reader.U32(kFileHeaderBytes + 4).value_or(0) < LeastBytes(reader, kFileHeaderBytes)) {
    scanned.defect = "its first chunk is too short to be a picture";
  }
  return scanned;
}

std::vector<std::uint8_t> WebpWithoutMetadata(Bytes bytes) {
  const ByteReader reader(bytes, false);
  bool some = false;
  WalkWebp(bytes, [&](std::size_t at, Bytes) { some = some || IsMetadata(reader, at); });
  if (!some) return {};
  std::vector<std::uint8_t> kept(bytes.begin(), bytes.begin() + kFileHeaderBytes);
  WalkWebp(bytes, [&](std::size_t at, Bytes chunk) {
    if (!IsMetadata(reader, at)) kept.insert(kept.end(), chunk.begin(), chunk.end());
  });
  const auto size = static_cast<std::uint32_t>(kept.size() - 8);
  for (int i = 0; i < 4; ++i) kept[4 + i] = static_cast<std::uint8_t>(size >> (8 * i));
  return kept;
}

}  // namespace pliant
