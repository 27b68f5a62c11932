// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The first directory (IFD) of a TIFF file, which is also the form EXIF blocks have (TIFF 6.0).
// Internal to the descriptor library.
#pragma once

#include <cstdint>
#include <string>

#include "descriptor/image/image.h"

namespace pliant {

struct TiffDirectory {
  std::int64_t width = 0;
  std::int64_t height = 0;
  int orientation = 1;              // 1..8
  std::int64_t bits = 1;            // a sample; the most where samples differ
  std::int64_t samples = 1;         // a pixel
  std::int64_t rows_per_strip = 0;  // 0 = not said: all
  std::int64_t tile_width = 0;      // 0 = strips
  std::int64_t tile_height = 0;
  bool complete = false;  // directory, its values and the pixels' data lie within the bytes
  std::string defect;     // what no program writes and readers may understand in two ways
};

// Never throws: what lies outside the bytes keeps its default, and complete is false. Time is
// linear in the number of bytes.
TiffDirectory ReadTiffDirectory(Bytes bytes);

// The orientation alone, 1 to 8, of an EXIF block; 1 when it is not there or makes no sense.
int ReadOrientation(Bytes exif);

}  // namespace pliant
