// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// An image as a texture: linear light, mip-mapped, bilinear.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "descriptor/image/image.h"

namespace pliant::simulation {

// Linear R, G, B; the fourth value is padding, so that a colour is one vector register.
using Colour = Eigen::Array4f;

// sRGB code value 0..255 to linear light 0..1.
float LinearFromSrgb(std::uint8_t code);

class Texture {
 public:
  // `image` has 1 or 3 channels.
  Texture(std::string name, const Image& image);

  const std::string& name() const { return name_; }
  int width() const { return levels_.front().width; }
  int height() const { return levels_.front().height; }
  float aspect() const { return static_cast<float>(height()) / static_cast<float>(width()); }

  // The colour at u, v in [0, 1] (clamped), blended between the two mip levels around `lod`
  // (0 = full resolution; each level halves it).
  Colour Sample(float u, float v, float lod) const;

 private:
  struct Level {
    int width = 0;
    int height = 0;
    std::vector<Colour> texels;
  };
  static Level Halve(const Level& level);
  static Colour Bilinear(const Level& level, float u, float v);

  std::string name_;
  std::vector<Level> levels_;
};

}  // namespace pliant::simulation
