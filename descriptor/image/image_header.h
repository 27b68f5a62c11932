// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Reading what a picture file's structure says, format by format, without decoding pixels: its
// size, whether it is whole, and what decoding it may cost. A file of a few kilobytes can claim
// gigabytes, and libraries differ in what they believe when a file says a thing twice; so what is
// contradictory or excessive is refused here, before a decoder sees it.
// Internal to the descriptor library; callers use ReadImageHeader of image.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "descriptor/image/image.h"

namespace pliant {

// What one walk over a file's structure tells.
struct ScannedImage {
  ImageHeader header;
  bool complete = true;       // the file does not end before its own structure says it does
  std::size_t jpeg_rest = 0;  // JPEG: where the walk for the size ended; see CheckStructure
  std::string defect = {};    // why the structure is refused, "it names ..."; empty = it is not

  // Memory of decoding: so many bytes a pixel of the decoder's result with its conversions to 8
  // bits of grey or colour, and so many more whatever the size of the result.
  std::int64_t pixel_bytes = 3;
  std::int64_t buffer_bytes = 0;
};

// Throws as ReadImageHeader does. Takes time linear in the file's size, with a small factor.
ScannedImage ScanImage(Bytes bytes);

// Throws Error "image_truncated" when the file ends before its own structure says it does:
// JPEG without an end marker, PNG without IEND, WebP/BMP/TIFF data beyond the end of the file; and
// "image_corrupt" for what no camera or program writes: a TIFF that names a tag twice, a
// progressive JPEG of thousands of scans, a PNG with more data than rows. Of a JPEG and a PNG this
// walks the pixels' data, which ScanImage leaves out (callers check the size first), and adds the
// memory that a JPEG's scans need.
void CheckStructure(Bytes bytes, ScannedImage& scanned);

// The file without what its pixels do not depend on: EXIF, colour profiles, texts, comments. The
// decoders would read some of it, and unpack compressed texts into any amount of memory. Empty when
// there is nothing to leave out (the given bytes will do), and for BMP and TIFF.
std::vector<std::uint8_t> WithoutMetadata(Bytes bytes, ImageFormat format);

// The formats' parts of the above.
ScannedImage ScanJpeg(Bytes bytes);
void CheckJpegScans(Bytes bytes, ScannedImage& scanned);  // sets complete and defect
std::vector<std::uint8_t> JpegWithoutMetadata(Bytes bytes);
ScannedImage ScanPng(Bytes bytes);
void CheckPngData(Bytes bytes, ScannedImage& scanned);  // sets defect
std::vector<std::uint8_t> PngWithoutMetadata(Bytes bytes);
ScannedImage ScanWebp(Bytes bytes);
std::vector<std::uint8_t> WebpWithoutMetadata(Bytes bytes);
ScannedImage ScanBmp(Bytes bytes);
ScannedImage ScanTiff(Bytes bytes);

}  // namespace pliant
