// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// PNG (ISO/IEC 15948): chunks of length, type, data, CRC.
#include <algorithm>
#include <array>
#include <span>

#include <zlib.h>

#include "descriptor/image/byte_reader.h"
#include "descriptor/image/image_header.h"
#include "descriptor/image/tiff_directory.h"

namespace pliant {
namespace {

constexpr std::size_t kSignatureBytes = 8;
constexpr std::size_t kChunkFrameBytes = 12;  // length, type and CRC

// Calls visit(type offset, data) for each chunk up to IEND; false when the file ends before it.
template <typename Visit>
bool WalkPng(Bytes bytes, Visit visit) {
  const ByteReader reader(bytes, true);
  std::size_t at = kSignatureBytes;
  while (const auto length = reader.U32(at)) {
    const std::size_t data = at + 8;
    if (data > bytes.size() || bytes.size() - data < std::size_t{*length} + 4) return false;
    visit(at + 4, bytes.subspan(data, *length));
    if (reader.StartsWith(at + 4, "IEND")) return true;
    at = data + *length + 4;
  }
  return false;
}

// The chunks on which pixels depend; the transparent colour is one of them.
bool IsForPixels(const ByteReader& reader, std::size_t type) {
  constexpr std::array kTypes = {"IHDR", "PLTE", "tRNS", "IDAT", "IEND"};
  return std::any_of(kTypes.begin(), kTypes.end(),
                     [&](const char* name) { return reader.StartsWith(type, name); });
}

// Of the decoder's result and of its conversions: 16 to 8 bits, transparency onto white, grey.
std::int64_t PixelBytes(int bit_depth, int colour_type, bool transparent_colour) {
  constexpr int kPalette = 3;
  const bool alpha = (colour_type & 4) != 0 || transparent_colour;
  const bool colour = (colour_type & 2) != 0 || colour_type == kPalette;
  const int channels = alpha ? 4 : colour ? 3 : 1;
  const int decoded = channels * (bit_depth == 16 ? 2 : 1);
  return std::max({bit_depth == 16 ? decoded + channels : decoded, alpha ? channels + 3 : 0,
                   colour ? 3 + 1 : 0});
}

// What the chunks of data unpack to: a byte for the filter and the samples of every row, for each
// of the seven passes where there are several (clause 8).
std::uint64_t DataBytes(std::uint64_t width, std::uint64_t height, int bit_depth, int colour_type,
                        bool interlaced) {
  struct Pass {
    unsigned x, y, step_x, step_y;
  };
  constexpr std::array<Pass, 7> kInterlaced = {{{0, 0, 8, 8},
                                                {4, 0, 8, 8},
                                                {0, 4, 4, 8},
                                                {2, 0, 4, 4},
                                                {0, 2, 2, 4},
                                                {1, 0, 2, 2},
                                                {0, 1, 1, 2}}};
  constexpr std::array<Pass, 1> kWhole = {{{0, 0, 1, 1}}};
  constexpr std::array<int, 7> kSamples = {1, 0, 3, 1, 2, 0, 4};  // by colour type
  const int samples = colour_type < 7 ? kSamples[static_cast<std::size_t>(colour_type)] : 0;
  const auto bits = static_cast<std::uint64_t>(samples * bit_depth);
  std::uint64_t sum = 0;
  for (const Pass& pass :
       interlaced ? std::span<const Pass>(kInterlaced) : std::span<const Pass>(kWhole)) {
    const std::uint64_t columns = (width + pass.step_x - 1 - pass.x) / pass.step_x;
    const std::uint64_t rows = (height + pass.step_y - 1 - pass.y) / pass.step_y;
    if (columns > 0) sum += rows * (1 + (columns * bits + 7) / 8);
  }
  return sum;
}

// Unpacks a PNG's data without keeping them.
class Unpacker {
 public:
  explicit Unpacker(std::uint64_t most) : most_(most), ready_(inflateInit(&stream_) == Z_OK) {}
  ~Unpacker() {
    if (ready_) inflateEnd(&stream_);
  }
  Unpacker(const Unpacker&) = delete;
  Unpacker& operator=(const Unpacker&) = delete;

  // Takes the next chunk; false as soon as there are more than the most bytes. What is damaged the
  // decoder will notice.
  bool Take(Bytes data) {
    stream_.next_in = const_cast<Bytef*>(data.data());  // zlib only reads
    stream_.avail_in = static_cast<uInt>(data.size());
    while (ready_ && stream_.avail_in > 0) {
      stream_.next_out = scratch_.data();
      stream_.avail_out = static_cast<uInt>(scratch_.size());
      const int status = inflate(&stream_, Z_NO_FLUSH);
      if (stream_.total_out > most_) return false;
      if (status != Z_OK) break;
    }
    return true;
  }

 private:
  const std::uint64_t most_;
  z_stream stream_{};
  bool ready_;
  std::array<Bytef, 32 * 1024> scratch_;
};

}  // namespace

ScannedImage ScanPng(Bytes bytes) {
  ScannedImage scanned{.header = {.format = ImageFormat::kPng}};
  ImageHeader& header = scanned.header;
  const ByteReader reader(bytes, true);
  if (!reader.StartsWith(12, "IHDR")) return scanned;
  constexpr std::uint32_t kHeaderBytes = 13;
  if (reader.U32(kSignatureBytes) != kHeaderBytes) {
    scanned.defect = "its header has another length than PNG's";
    return scanned;
  }
  header.width = reader.U32(16).value_or(0);
  header.height = reader.U32(20).value_or(0);
  bool exif = false;
  bool transparent_colour = false;
  scanned.complete = WalkPng(bytes, [&](std::size_t type, Bytes data) {
    if (reader.StartsWith(type, "tRNS")) transparent_colour = true;
    if (!exif && reader.StartsWith(type, "eXIf")) {
      header.exif_orientation = ReadOrientation(data);
      exif = true;
    }
  });
  scanned.pixel_bytes =
      PixelBytes(reader.U8(24).value_or(0), reader.U8(25).value_or(0), transparent_colour);
  return scanned;
}

// Data may unpack to a thousand times their size, and libpng unpacks them to their end, also behind
// the last row.
void CheckPngData(Bytes bytes, ScannedImage& scanned) {
  const ByteReader reader(bytes, true);
  const std::uint64_t rows =
      DataBytes(static_cast<std::uint64_t>(scanned.header.width),
                static_cast<std::uint64_t>(scanned.header.height), reader.U8(24).value_or(0),
                reader.U8(25).value_or(0), reader.U8(28).value_or(0) != 0);
  constexpr std::uint64_t kTolerated = 64 * 1024;
  Unpacker unpacker(rows + kTolerated);
  bool fits = true;
  WalkPng(bytes, [&](std::size_t type, Bytes data) {
    if (fits && reader.StartsWith(type, "IDAT")) fits = unpacker.Take(data);
  });
  if (!fits) scanned.defect = "it holds more data than its rows";
}

std::vector<std::uint8_t> PngWithoutMetadata(Bytes bytes) {
  const ByteReader reader(bytes, true);
  bool all = true;
  WalkPng(bytes, [&](std::size_t type, Bytes) { all = all && IsForPixels(reader, type); });
  if (all) return {};
  std::vector<std::uint8_t> kept(bytes.begin(), bytes.begin() + kSignatureBytes);
  WalkPng(bytes, [&](std::size_t type, Bytes data) {
    if (!IsForPixels(reader, type)) return;
    const Bytes chunk = bytes.subspan(type - 4, data.size() + kChunkFrameBytes);
    kept.insert(kept.end(), chunk.begin(), chunk.end());
  });
  return kept;
}

}  // namespace pliant
