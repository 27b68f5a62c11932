// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// TIFF 6.0: directories of tags that point to strips or tiles of pixels. The first directory
// counts.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <tiffio.h>

#include "descriptor/image/image_header.h"

namespace pliant {
namespace {

constexpr std::uint32_t kMostPieces = 65'536;  // libtiff starts again for every strip or tile
constexpr tmsize_t kMostTableBytes = tmsize_t{256} << 20;
// Three of colour and one of grey; colours are there twice while they are turned.
constexpr std::int64_t kPixelBytes = 4;
constexpr std::int64_t kTurnedPixelBytes = 6;

// A file in memory, as libtiff reads it.
struct MemoryFile {
  Bytes bytes;
  std::uint64_t at = 0;
};

tmsize_t Read(thandle_t handle, void* to, tmsize_t size) {
  auto& file = *static_cast<MemoryFile*>(handle);
  if (file.at >= file.bytes.size()) return 0;
  const std::size_t count = std::min(static_cast<std::size_t>(size), file.bytes.size() - file.at);
  std::memcpy(to, file.bytes.data() + file.at, count);
  file.at += count;
  return static_cast<tmsize_t>(count);
}

toff_t Seek(thandle_t handle, toff_t offset, int from) {
  auto& file = *static_cast<MemoryFile*>(handle);
  const std::uint64_t base =
      from == SEEK_CUR ? file.at : (from == SEEK_END ? file.bytes.size() : 0);
  return file.at = base + offset;
}

int Map(thandle_t handle, void** base, toff_t* size) {
  const Bytes bytes = static_cast<MemoryFile*>(handle)->bytes;
  *base = const_cast<std::uint8_t*>(bytes.data());  // libtiff only reads
  *size = bytes.size();
  return 1;
}

int KeepSilent(TIFF*, void*, const char*, const char*, va_list) { return 1; }

struct Close {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};
using Tiff = std::unique_ptr<TIFF, Close>;

// Null if there is no readable directory. `file` must live as long.
Tiff Open(MemoryFile& file) {
  TIFFOpenOptions* options = TIFFOpenOptionsAlloc();
  TIFFOpenOptionsSetMaxSingleMemAlloc(options, kMostTableBytes);
  TIFFOpenOptionsSetErrorHandlerExtR(options, KeepSilent, nullptr);
  TIFFOpenOptionsSetWarningHandlerExtR(options, KeepSilent, nullptr);
  Tiff tiff(TIFFClientOpenExt(
      "", "r", &file, Read, [](thandle_t, void*, tmsize_t) -> tmsize_t { return 0; }, Seek,
      [](thandle_t) { return 0; },
      [](thandle_t handle) -> toff_t { return static_cast<MemoryFile*>(handle)->bytes.size(); },
      Map, [](thandle_t, void*, toff_t) {}, options));
  TIFFOpenOptionsFree(options);
  return tiff;
}

template <typename T>
T Field(const Tiff& tiff, std::uint32_t tag, T otherwise) {
  T value{};
  return TIFFGetFieldDefaulted(tiff.get(), tag, &value) != 0 ? value : otherwise;
}

std::uint32_t Pieces(const Tiff& tiff) {
  return TIFFIsTiled(tiff.get()) != 0 ? TIFFNumberOfTiles(tiff.get())
                                      : TIFFNumberOfStrips(tiff.get());
}

struct PieceSize {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
};

PieceSize PieceSizeOf(const Tiff& tiff, const ImageHeader& header) {
  if (TIFFIsTiled(tiff.get()) != 0) {
    return {Field<std::uint32_t>(tiff, TIFFTAG_TILEWIDTH, 0),
            Field<std::uint32_t>(tiff, TIFFTAG_TILELENGTH, 0)};
  }
  const auto height = static_cast<std::uint32_t>(header.height);
  return {static_cast<std::uint32_t>(header.width),
          std::min(Field<std::uint32_t>(tiff, TIFFTAG_ROWSPERSTRIP, height), height)};
}

// libtiff decodes a strip or a tile at a time, and then makes four bytes of each pixel. Of numbers
// that nobody has checked.
std::int64_t BufferBytes(const Tiff& tiff, const PieceSize& piece) {
  const double bits = 1.0 * Field<std::uint16_t>(tiff, TIFFTAG_BITSPERSAMPLE, 1) *
                      Field<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  const double bytes = 1.0 * piece.width * piece.height * (4 + (bits + 7) / 8);
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max() / 4;
  return bytes < static_cast<double>(kMost) ? static_cast<std::int64_t>(bytes) : kMost;
}

// Whether the pixels' data lie within the file, and not over one another.
void CheckPieces(const Tiff& tiff, std::size_t file_bytes, ScannedImage& scanned) {
  const std::uint32_t pieces = Pieces(tiff);
  if (pieces > kMostPieces) {
    scanned.defect = "it has " + std::to_string(pieces) + " strips or tiles";
    return;
  }
  std::uint64_t total = 0;
  for (std::uint32_t i = 0; i < pieces; ++i) {
    const std::uint64_t offset = TIFFGetStrileOffset(tiff.get(), i);
    const std::uint64_t size = TIFFGetStrileByteCount(tiff.get(), i);
    if (offset > file_bytes || size > file_bytes - offset) scanned.complete = false;
    total += std::min<std::uint64_t>(size, file_bytes);
  }
  if (total > file_bytes && scanned.complete) {
    scanned.defect = "its strips or tiles overlap";
  }
}

// One strip or tile at (x, y), of pixels with premultiplied alpha, bottom row first, onto white.
void Place(const std::vector<std::uint32_t>& raster, const PieceSize& piece, int rows, int x, int y,
           cv::Mat& pixels) {
  const int columns = std::min(static_cast<int>(piece.width), pixels.cols - x);
  const auto onto_white = [](std::uint32_t value, std::uint32_t alpha) {
    return static_cast<std::uint8_t>(std::min(255U, value + 255 - alpha));
  };
  for (int row = 0; row < std::min(rows, pixels.rows - y); ++row) {
    const std::uint32_t* from =
        raster.data() + static_cast<std::size_t>(rows - 1 - row) * piece.width;
    auto* to = pixels.ptr<cv::Vec3b>(y + row) + x;
    for (int i = 0; i < columns; ++i) {
      const std::uint32_t alpha = TIFFGetA(from[i]);
      to[i] = {onto_white(TIFFGetB(from[i]), alpha), onto_white(TIFFGetG(from[i]), alpha),
               onto_white(TIFFGetR(from[i]), alpha)};
    }
  }
}

}  // namespace

ScannedImage ScanTiff(Bytes bytes) {
  ScannedImage scanned{.header = {.format = ImageFormat::kTiff}, .pixel_bytes = kPixelBytes};
  MemoryFile file{bytes};
  const Tiff tiff = Open(file);
  if (!tiff) return scanned;
  scanned.header.width = Field<std::uint32_t>(tiff, TIFFTAG_IMAGEWIDTH, 0);
  scanned.header.height = Field<std::uint32_t>(tiff, TIFFTAG_IMAGELENGTH, 0);
  const int orientation = Field<std::uint16_t>(tiff, TIFFTAG_ORIENTATION, 1);
  if (orientation >= 1 && orientation <= 8) scanned.header.exif_orientation = orientation;
  if (scanned.header.exif_orientation >= 5) scanned.pixel_bytes = kTurnedPixelBytes;
  scanned.buffer_bytes = BufferBytes(tiff, PieceSizeOf(tiff, scanned.header));
  CheckPieces(tiff, bytes.size(), scanned);
  return scanned;
}

cv::Mat DecodeTiff(Bytes bytes, const ImageHeader& header, bool /*colour*/, int /*reduction*/) {
  MemoryFile file{bytes};
  const Tiff tiff = Open(file);
  char reason[1024] = "";
  if (!tiff || TIFFRGBAImageOK(tiff.get(), reason) == 0) {
    std::string_view text(reason);
    if (text.starts_with("Sorry, ")) text.remove_prefix(7);
    ThrowUndecodable(std::string(text));
  }
  TIFFSetField(tiff.get(), TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);  // callers turn it upright
  const PieceSize piece = PieceSizeOf(tiff, header);
  if (piece.width == 0 || piece.height == 0) ThrowUndecodable("empty strips");
  const bool tiled = TIFFIsTiled(tiff.get()) != 0;
  cv::Mat pixels(static_cast<int>(header.height), static_cast<int>(header.width), CV_8UC3);
  std::vector<std::uint32_t> raster(std::size_t{piece.width} * piece.height);
  for (int y = 0; y < pixels.rows; y += static_cast<int>(piece.height)) {
    for (int x = 0; x < pixels.cols; x += static_cast<int>(piece.width)) {
      const auto column = static_cast<std::uint32_t>(x);
      const auto row = static_cast<std::uint32_t>(y);
      const int read = tiled ? TIFFReadRGBATile(tiff.get(), column, row, raster.data())
                             : TIFFReadRGBAStrip(tiff.get(), row, raster.data());
      if (read == 0) ThrowUndecodable();
      // The last strip has the rows that are left; a tile is always whole.
      const int rows = tiled ? static_cast<int>(piece.height)
                             : std::min(static_cast<int>(piece.height), pixels.rows - y);
      Place(raster, piece, rows, x, y, pixels);
    }
  }
  return pixels;
}

}  // namespace pliant
