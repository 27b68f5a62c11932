// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Image files, format by format: first what the structure says (size, completeness, cost of
// decoding), because a file of a few kilobytes can claim gigabytes; then the pixels, by the library
// of the format: libjpeg-turbo, libpng, libwebp, libtiff, OpenCV for BMP. Metadata are not decoded.
// Internal to the descriptor library; callers use image.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include <opencv2/core.hpp>

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
// "image_corrupt" for what no camera or program writes: TIFF strips that overlap, a progressive
// JPEG of thousands of scans. Of a JPEG this walks the pixels' data, which ScanImage leaves out
// (callers check the size first), and adds the memory that its scans need.
void CheckStructure(Bytes bytes, ScannedImage& scanned);

// The pixels as they are stored, not turned upright, 8 bits each: grey, B, G, R, or B, G, R, A. A
// JPEG gives grey if no colour is wanted, at 1/reduction of its size (1, 2, 4, 8); the others give
// what they have. Throws Error "image_corrupt", also if the decoder finds another size than the
// header says.
cv::Mat DecodePixels(Bytes bytes, const ImageHeader& header, bool colour, int reduction);

[[noreturn]] void ThrowUndecodable(const std::string& detail = {});

// The formats' parts of the above.
ScannedImage ScanJpeg(Bytes bytes);
void CheckJpegScans(Bytes bytes, ScannedImage& scanned);  // sets complete and defect
cv::Mat DecodeJpeg(Bytes bytes, bool colour, int reduction);
ScannedImage ScanPng(Bytes bytes);
cv::Mat DecodePng(Bytes bytes);
ScannedImage ScanWebp(Bytes bytes);
cv::Mat DecodeWebp(Bytes bytes, const ImageHeader& header);
ScannedImage ScanBmp(Bytes bytes);
cv::Mat DecodeBmp(Bytes bytes);
ScannedImage ScanTiff(Bytes bytes);
cv::Mat DecodeTiff(Bytes bytes, const ImageHeader& header);

}  // namespace pliant
