// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Binary PGM and PPM, the simulator's textures.
#include "descriptor/simulation/texture.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using pliant::fuzz::Require;
  pliant::Image image;
  if (!pliant::fuzz::Accepts([&] { image = pliant::simulation::DecodePnm({data, size}); })) {
    return 0;
  }
  Require(image.width > 0 && image.height > 0, "an image has a size");
  Require(image.pixels.size() == static_cast<std::size_t>(image.width) *
                                     static_cast<std::size_t>(image.height) *
                                     static_cast<std::size_t>(image.channels),
          "an image has all its pixels");
  Require(image.pixels.size() < size, "pixels are bytes of the file");
  return 0;
}
