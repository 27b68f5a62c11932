// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The first directory (IFD) of a TIFF file, which is also the form EXIF blocks have (TIFF 6.0).
// Internal to the descriptor library.
#pragma once

#include <cstdint>
#include <vector>

#include "descriptor/image/image.h"

namespace pliant {

struct TiffDirectory {
  std::int64_t width = 0;
  std::int64_t height = 0;
  int orientation = 1;                      // 1..8
  std::vector<std::uint32_t> data_offsets;  // of strips or tiles
  std::vector<std::uint32_t> data_bytes;    // their sizes
  bool complete = false;                    // the directory and all its values lie within the bytes
};

// Never throws: what lies outside the bytes keeps its default, and complete is false.
TiffDirectory ReadTiffDirectory(Bytes bytes);

}  // namespace pliant
