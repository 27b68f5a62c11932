// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The colours of an image, coarse. Descriptors see grey only; what is told apart by its colour is
// told apart by these.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "descriptor/image/image.h"

namespace pliant {

// Means of chroma (CIELAB's a* and b*, each + 128) over equal cells of an image. Empty where the
// colours are not known: of a grey image, or one that was described without.
struct ColourGrid {
  int width = 0;  // cells
  int height = 0;
  std::vector<std::uint8_t> chroma;  // height x width x 2: a*, b*

  bool empty() const { return chroma.empty(); }
  bool operator==(const ColourGrid&) const = default;
};

// At most kColourGridSide cells along the longer side, square ones, of a colour image. Empty for
// a grey one, and for one whose pixels are all grey. Thread-safe.
inline constexpr int kColourGridSide = 64;
ColourGrid MakeColourGrid(const Image& image);

}  // namespace pliant
