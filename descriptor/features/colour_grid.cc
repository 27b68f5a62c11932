// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/colour_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace pliant {
namespace {

// IEC 61966-2-1: the light of each 8-bit value.
const std::array<float, 256>& LinearLight() {
  static const std::array<float, 256> kTable = [] {
    std::array<float, 256> table{};
    for (std::size_t i = 0; i < table.size(); ++i) {
      const double value = static_cast<double>(i) / 255;
      table[i] = static_cast<float>(value <= 0.04045 ? value / 12.92
                                                     : std::pow((value + 0.055) / 1.055, 2.4));
    }
    return table;
  }();
  return kTable;
}

std::uint8_t Rounded(float chroma) {
  return static_cast<std::uint8_t>(std::clamp(std::lround(chroma + 128), 0L, 255L));
}

// CIE 15: a* and b* under D65. Ours, since OpenCV makes 5 MB of tables for it, which takes 0.1 s.
std::array<std::uint8_t, 2> ChromaOf(const std::uint8_t* rgb) {
  const float r = LinearLight()[rgb[0]];
  const float g = LinearLight()[rgb[1]];
  const float b = LinearLight()[rgb[2]];
  const auto root = [](float t) { return t > 0.008856F ? std::cbrt(t) : 7.787F * t + 16.0F / 116; };
  const float x = root((0.412453F * r + 0.357580F * g + 0.180423F * b) / 0.950456F);
  const float y = root(0.212671F * r + 0.715160F * g + 0.072169F * b);
  const float z = root((0.019334F * r + 0.119193F * g + 0.950227F * b) / 1.088754F);
  return {Rounded(500 * (x - y)), Rounded(200 * (y - z))};
}

}  // namespace

ColourGrid MakeColourGrid(const Image& image, int side) {
  if (image.channels != 3 || image.empty()) return {};
  const ScaledSize size = ScaleToFit(image.width, image.height, side);
  const Image cells = ResizeImage(image, size.width, size.height);
  ColourGrid grid{size.width, size.height, {}};
  grid.chroma.reserve(cells.pixels.size() / 3 * 2);
  bool grey = true;
  for (std::size_t i = 0; i < cells.pixels.size(); i += 3) {
    for (const std::uint8_t chroma : ChromaOf(&cells.pixels[i])) {
      grid.chroma.push_back(chroma);
      grey = grey && chroma == 128;
    }
  }
  if (grey) return {};
  return grid;
}

}  // namespace pliant
