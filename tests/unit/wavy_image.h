// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A grey image of waves with some noise, for the network and its benchmark.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>

#include "descriptor/image/image.h"

namespace pliant::testing {

// Waves of `across_px` and `down_px` pixels a radian.
inline Image WavyImage(int width, int height, double across_px, double down_px,
                       std::uint32_t seed) {
  std::mt19937 random(seed);
  Image image;
  image.width = width;
  image.height = height;
  for (int i = 0; i < width * height; ++i) {
    image.pixels.push_back(static_cast<std::uint8_t>(
        128 + 90 * std::sin(i % width / across_px) * std::cos(i / width / down_px) +
        random() % 30));
  }
  return image;
}

}  // namespace pliant::testing
