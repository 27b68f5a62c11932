// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Reading what a picture file's header says, format by format, without decoding pixels.
// Internal to the descriptor library; callers use ReadImageHeader of image.h.
#pragma once

#include <cstddef>

#include "descriptor/image/image.h"

namespace pliant {

// What one walk over a file's structure tells.
struct ScannedImage {
  ImageHeader header;
  bool complete = true;       // the file does not end before its own structure says it does
  std::size_t jpeg_rest = 0;  // JPEG: where the walk for the size ended; see CheckComplete
};

// Throws as ReadImageHeader does.
ScannedImage ScanImage(Bytes bytes);

// Throws Error "image_truncated" when the file ends before its own structure says it does:
// JPEG without an end marker, PNG without IEND, WebP/BMP/TIFF data beyond the end of the file. Of a
// JPEG this walks the pixels' data, which ScanImage leaves out: callers check the size first.
void CheckComplete(Bytes bytes, const ScannedImage& scanned);

}  // namespace pliant
