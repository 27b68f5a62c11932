// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The orientation of an EXIF block.
#include "descriptor/image/image_header.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const int orientation = pliant::ReadOrientation({data, size});
  pliant::fuzz::Require(orientation >= 1 && orientation <= 8, "an orientation is 1 to 8");
  return 0;
}
