// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace pliant::simulation {
namespace {

std::array<float, 256> MakeLinearTable() {
  std::array<float, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    const float x = static_cast<float>(i) / 255.0F;
    table[i] = x <= 0.04045F ? x / 12.92F : std::pow((x + 0.055F) / 1.055F, 2.4F);
  }
  return table;
}

}  // namespace

float LinearFromSrgb(std::uint8_t code) {
  static const std::array<float, 256> table = MakeLinearTable();
  return table[code];
}

Texture::Texture(std::string name, const Image& image) : name_(std::move(name)) {
  Level base{image.width, image.height, {}};
  base.texels.reserve(static_cast<std::size_t>(image.width) * image.height);
  const auto channels = static_cast<std::size_t>(image.channels);
  for (std::size_t i = 0; i < image.pixels.size(); i += channels) {
    const float red = LinearFromSrgb(image.pixels[i]);
    const float green = channels == 3 ? LinearFromSrgb(image.pixels[i + 1]) : red;
    const float blue = channels == 3 ? LinearFromSrgb(image.pixels[i + 2]) : red;
    base.texels.emplace_back(red, green, blue, 0.0F);
  }
  levels_.push_back(std::move(base));
  while (levels_.back().width > 2 && levels_.back().height > 2)
    levels_.push_back(Halve(levels_.back()));
}

// Each texel of the half-size level averages the area it covers, also for odd sizes.
Texture::Level Texture::Halve(const Level& level) {
  Level half{level.width / 2, level.height / 2, {}};
  half.texels.reserve(static_cast<std::size_t>(half.width) * half.height);
  const auto at = [&level](int x, int y) -> const Colour& {
    return level.texels[static_cast<std::size_t>(std::min(y, level.height - 1)) * level.width +
                        std::min(x, level.width - 1)];
  };
  const auto sums = [&](int x, int y) {
    // Even sizes: the mean of two texels; odd ones: 1, 2, 1 around the middle one.
    const bool wide = level.width % 2 == 1;
    return wide ? Colour(0.25F * at(2 * x, y) + 0.5F * at(2 * x + 1, y) + 0.25F * at(2 * x + 2, y))
                : Colour(0.5F * (at(2 * x, y) + at(2 * x + 1, y)));
  };
  for (int y = 0; y < half.height; ++y) {
    for (int x = 0; x < half.width; ++x) {
      if (level.height % 2 == 1) {
        half.texels.emplace_back(0.25F * sums(x, 2 * y) + 0.5F * sums(x, 2 * y + 1) +
                                 0.25F * sums(x, 2 * y + 2));
      } else {
        half.texels.emplace_back(0.5F * (sums(x, 2 * y) + sums(x, 2 * y + 1)));
      }
    }
  }
  return half;
}

Colour Texture::Bilinear(const Level& level, float u, float v) {
  const float x = std::clamp(u * static_cast<float>(level.width) - 0.5F, 0.0F,
                             static_cast<float>(level.width - 1));
  const float y = std::clamp(v * static_cast<float>(level.height) - 0.5F, 0.0F,
                             static_cast<float>(level.height - 1));
  const int x0 = static_cast<int>(x);
  const int y0 = static_cast<int>(y);
  const int step_x = x0 + 1 < level.width ? 1 : 0;
  const int step_y = y0 + 1 < level.height ? level.width : 0;
  const float fx = x - static_cast<float>(x0);
  const float fy = y - static_cast<float>(y0);
  const Colour* texel = level.texels.data() + static_cast<std::ptrdiff_t>(y0) * level.width + x0;
  const Colour top = texel[0] + fx * (texel[step_x] - texel[0]);
  const Colour bottom = texel[step_y] + fx * (texel[step_y + step_x] - texel[step_y]);
  return top + fy * (bottom - top);
}

Colour Texture::Sample(float u, float v, float lod) const {
  const auto last = static_cast<float>(levels_.size() - 1);
  const float level = std::clamp(lod, 0.0F, last);
  const auto lower = static_cast<std::size_t>(level);
  const float blend = level - static_cast<float>(lower);
  const Colour fine = Bilinear(levels_[lower], u, v);
  if (blend < 0.02F || lower + 1 >= levels_.size()) return fine;
  return fine + blend * (Bilinear(levels_[lower + 1], u, v) - fine);
}

}  // namespace pliant::simulation
