// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/artwork.h"

#include <algorithm>
#include <cmath>

#include "descriptor/simulation/procedural_painters.h"

namespace pliant::simulation {
namespace {

constexpr int kSide = 320;  // of the drawing's longer side, pixels
constexpr int kGrounds = 4;

// Paints over black and over white alike; where the two differ the ground shows.
template <typename Painter>
Artwork Paint(int width, int height, Random& random, Painter&& paint) {
  Canvas black(width, height, Ink::Zero());
  Canvas white(width, height, Ink::Ones());
  Random again = random;
  paint(black, again);
  paint(white, random);
  Artwork artwork;
  artwork.width = width;
  artwork.height = height;
  artwork.inks.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  std::size_t i = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x, ++i) {
      const Ink ink = black.At(x, y);
      const float cover = std::clamp(1.0F - (white.At(x, y) - ink).mean(), 0.0F, 1.0F);
      artwork.inks[i] << ink.min(cover).max(0.0F), cover;
    }
  }
  return artwork;
}

Artwork PaintArtwork(Random& random) {
  const float aspect = random.LogUniform(0.7F, 1.4F);
  const int width =
      static_cast<int>(std::lround(static_cast<float>(kSide) * std::min(1.0F, 1.0F / aspect)));
  const int height =
      static_cast<int>(std::lround(static_cast<float>(kSide) * std::min(1.0F, aspect)));
  const Palette palette(random);
  const float kind = random.Uniform();
  const Ink outline = random.Chance(0.8F) ? Ink(palette.dark.min(0.25F)) : Ink(palette.paper);
  return Paint(width, height, random, [&](Canvas& canvas, Random& draw) {
    if (kind < 0.7F) {
      PaintFigure(canvas, draw, outline);
    } else if (kind < 0.82F) {
      PaintLogo(canvas, draw, palette);
    } else if (kind < 0.92F) {
      PaintLettering(canvas, draw, palette);
    } else {
      PaintFloral(canvas, draw, palette);
    }
  });
}

Eigen::Array4f InkAt(const Artwork& artwork, float x, float y) {
  const float cx = std::clamp(x, 0.0F, static_cast<float>(artwork.width - 1));
  const float cy = std::clamp(y, 0.0F, static_cast<float>(artwork.height - 1));
  const int x0 = std::min(static_cast<int>(cx), artwork.width - 2);
  const int y0 = std::min(static_cast<int>(cy), artwork.height - 2);
  const float fx = cx - static_cast<float>(x0);
  const float fy = cy - static_cast<float>(y0);
  const Eigen::Array4f* row = artwork.inks.data() + static_cast<std::ptrdiff_t>(y0) * artwork.width;
  const Eigen::Array4f top = row[x0] + fx * (row[x0 + 1] - row[x0]);
  row += artwork.width;
  const Eigen::Array4f bottom = row[x0] + fx * (row[x0 + 1] - row[x0]);
  return top + fy * (bottom - top);
}

std::uint8_t ToByte(float value) {
  return static_cast<std::uint8_t>(std::clamp(value * 255.0F + 0.5F, 0.0F, 255.0F));
}

}  // namespace

Ink DrawClothColour(Random& random) {
  const float kind = random.Uniform();
  if (kind < 0.25F) return Ink::Constant(random.Uniform(0.85F, 1.0F));
  if (kind < 0.5F) return Ink::Constant(random.Uniform(0.03F, 0.18F));
  if (kind < 0.62F) return Ink::Constant(random.Uniform(0.3F, 0.75F));
  return FromHue(random.Uniform(), random.Uniform(0.15F, 0.9F), random.Uniform(0.15F, 0.95F));
}

float Contrast(const Artwork& artwork, const Ink& cloth) {
  float sum = 0.0F;
  float cover = 1e-3F;
  for (const Eigen::Array4f& ink : artwork.inks) {
    sum += (ink.head<3>() - ink[3] * cloth).abs().mean();
    cover += ink[3];
  }
  return sum / cover;
}

float Brighter(const Artwork& artwork, const Ink& cloth) {
  float sum = 0.0F;
  float cover = 1e-3F;
  for (const Eigen::Array4f& ink : artwork.inks) {
    sum += (ink.head<3>() - ink[3] * cloth).mean();
    cover += ink[3];
  }
  return sum / cover;
}

Artwork DrawArtwork(Random& random, const Texture* picture) {
  const bool stencil = picture != nullptr && random.Chance(0.5F);
  Artwork artwork = stencil ? DrawStencil(random, *picture) : PaintArtwork(random);
  float best = -1.0F;
  for (int i = 0; i < kGrounds; ++i) {
    const Ink ground = DrawClothColour(random);
    const float contrast = Contrast(artwork, ground);
    if (contrast <= best) continue;
    best = contrast;
    artwork.ground = ground;
  }
  return artwork;
}

Image PrintOn(const Artwork& artwork, const PrintPlace& place, const PrintOptions& options,
              int width, int height, Random& random) {
  Image image{width, height, 3, {}};
  image.pixels.reserve(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const Noise noise(random);
  const Eigen::Array2f size = place.high - place.low;
  for (int y = 0; y < height; ++y) {
    const float v = (static_cast<float>(y) + 0.5F) / static_cast<float>(height);
    const float t = (v - place.low.y()) / size.y();
    for (int x = 0; x < width; ++x) {
      const float u = (static_cast<float>(x) + 0.5F) / static_cast<float>(width);
      const float s = (u - place.low.x()) / size.x();
      Ink colour = options.cloth;
      if (s >= 0.0F && t >= 0.0F && s <= 1.0F && t <= 1.0F) {
        const Eigen::Array4f ink = InkAt(artwork, s * static_cast<float>(artwork.width) - 0.5F,
                                         t * static_cast<float>(artwork.height) - 0.5F);
        const float worn = noise.At(60.0F * u, 60.0F * v, 3);
        const float strength =
            options.opacity * (1.0F - options.fading * std::max(0.0F, 2.0F * worn - 0.8F));
        colour += strength * (ink.head<3>() - ink[3] * colour);
      }
      for (int c = 0; c < 3; ++c) image.pixels.push_back(ToByte(colour[c]));
    }
  }
  return image;
}

}  // namespace pliant::simulation
