// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The coarse colours of an image. Descriptors see grey only; these tell apart objects that differ
// in colour.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "descriptor/image/image.h"

namespace pliant {

// Means of chroma (CIELAB's a* and b*, each + 128) over equal cells of an image. Empty if the
// colours are unknown: the image is grey, or was described without colours.
struct ColourGrid {
  int width = 0;  // cells
  int height = 0;
  std::vector<std::uint8_t> chroma;  // height x width x 2: a*, b*

  bool empty() const { return chroma.empty(); }
  bool operator==(const ColourGrid&) const = default;
};

// The grid of a colour image: square cells, at most `side` along the longer side. Empty for a grey
// image, also if it is stored in colour. Thread-safe.
inline constexpr int kColourGridSide = 64;
ColourGrid MakeColourGrid(const Image& image, int side = kColourGridSide);

}  // namespace pliant
