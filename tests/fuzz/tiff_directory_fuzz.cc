// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The first directory of a TIFF file, and the orientation of an EXIF block.
#include "descriptor/image/tiff_directory.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using pliant::fuzz::Require;
  const pliant::Bytes bytes(data, size);
  const pliant::TiffDirectory directory = pliant::ReadTiffDirectory(bytes);
  const int orientation = pliant::ReadOrientation(bytes);
  Require(orientation >= 1 && orientation <= 8, "an orientation is 1 to 8");
  Require(!directory.defect.empty() || directory.orientation == orientation,
          "a directory without defect has one orientation");
  Require(directory.width >= 0 && directory.height >= 0 && directory.bits >= 0 &&
              directory.samples >= 0 && directory.rows_per_strip >= 0 &&
              directory.tile_width >= 0 && directory.tile_height >= 0,
          "sizes are not negative");
  return 0;
}
