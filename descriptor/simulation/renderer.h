// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Renders surfaces, lights and a camera to a picture with its ground truth.
#pragma once

#include <cstdint>
#include <vector>

#include "descriptor/simulation/camera.h"
#include "descriptor/simulation/lighting.h"
#include "descriptor/simulation/surface.h"

namespace pliant::simulation {

inline constexpr std::uint8_t kNoChart = 255;

// A picture in linear light and, per pixel, what the pixel's centre sees.
struct Frame {
  int width = 0;
  int height = 0;
  std::vector<Colour> colour;       // height x width
  std::vector<std::uint8_t> chart;  // chart of the object's front, or kNoChart
  std::vector<std::uint16_t> uv;    // height x width x 2, 65535 = 1; 0 where there is no chart

  std::size_t At(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(x);
  }
  // Share of the pixels that show the object.
  double Coverage() const;
};

// Draws with 2 x 2 samples per pixel over `backdrop` (height x width, or empty for black). Back
// faces of a chart hide what is behind them and count as no chart.
Frame Render(const std::vector<Surface>& surfaces, const Lighting& lighting, const Camera& camera,
             const std::vector<Colour>& backdrop);

}  // namespace pliant::simulation
