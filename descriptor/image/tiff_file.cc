// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// TIFF 6.0: directories of tags that point to strips or tiles of pixels.
#include <algorithm>
#include <limits>

#include "descriptor/image/image_header.h"
#include "descriptor/image/tiff_directory.h"

namespace pliant {
namespace {

// Of numbers that nobody has checked: the product may be beyond 64 bits.
std::int64_t Product(std::int64_t a, std::int64_t b) {
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max() / 4;
  return a != 0 && b > kMost / a ? kMost : a * b;
}

// libtiff decodes a strip or a tile at a time, and then makes four bytes of each pixel.
std::int64_t BufferBytes(const TiffDirectory& directory) {
  const bool tiled = directory.tile_width > 0 || directory.tile_height > 0;
  const std::int64_t rows = directory.rows_per_strip > 0
                                ? std::min(directory.rows_per_strip, directory.height)
                                : directory.height;
  const std::int64_t pixels =
      tiled ? Product(directory.tile_width, directory.tile_height) : Product(directory.width, rows);
  const std::int64_t bits = Product(directory.bits, directory.samples);
  return Product(pixels, 4 + (bits + 7) / 8);
}

// Three of colour and one of grey. OpenCV turns TIFF itself: colours are there twice then.
constexpr std::int64_t kPixelBytes = 4;
constexpr std::int64_t kTurnedPixelBytes = 6;

}  // namespace

ScannedImage ScanTiff(Bytes bytes) {
  const TiffDirectory directory = ReadTiffDirectory(bytes);
  ScannedImage scanned{.header = {.format = ImageFormat::kTiff,
                                  .width = directory.width,
                                  .height = directory.height,
                                  .exif_orientation = directory.orientation},
                       .complete = directory.complete,
                       .defect = directory.defect,
                       .pixel_bytes = kPixelBytes};
  if (scanned.header.exif_orientation >= 5) scanned.pixel_bytes = kTurnedPixelBytes;
  scanned.buffer_bytes = BufferBytes(directory);
  return scanned;
}

}  // namespace pliant
