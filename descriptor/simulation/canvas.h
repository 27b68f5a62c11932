// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// An image to paint on with anti-aliased shapes and stroked letters, for procedural textures.
#pragma once

#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "descriptor/image/image.h"
#include "descriptor/simulation/random.h"
#include "descriptor/simulation/texture.h"

namespace pliant::simulation {

using Ink = Eigen::Array3f;  // sRGB values 0..1
using Point = Eigen::Array2f;

class Canvas {
 public:
  Canvas(int width, int height, const Ink& paper);

  int width() const { return width_; }
  int height() const { return height_; }
  Ink& At(int x, int y) { return pixels_[static_cast<std::size_t>(y) * width_ + x]; }

  void Rectangle(const Point& low, const Point& high, const Ink& ink, float opacity = 1.0F);
  // An ellipse turned by `angle`; a petal when `taper` > 0 (narrower towards its +x end).
  void Ellipse(const Point& centre, const Point& radii, float angle, const Ink& ink,
               float taper = 0.0F);
  void Line(const Point& from, const Point& to, float thickness, const Ink& ink);
  void Ring(const Point& centre, float radius, float thickness, const Ink& ink);
  // Filled by the even-odd rule.
  void Polygon(const std::vector<Point>& corners, const Ink& ink);
  // Capital letters, digits and a few signs of the given height; `baseline_left` is the start of
  // the base line. Returns the advance. Other characters are spaces.
  float Text(std::string_view text, const Point& baseline_left, float letter_height,
             float thickness, const Ink& ink, float slant = 0.0F);

  Image ToImage() const;

 private:
  template <typename Distance>
  void Fill(const Point& low, const Point& high, const Ink& ink, float opacity,
            Distance&& distance);

  int width_, height_;
  std::vector<Ink> pixels_;
};

// Smooth noise in [0, 1] with `octaves` of detail; one cell is one unit.
class Noise {
 public:
  explicit Noise(Random& random);
  float At(float x, float y, int octaves) const;

 private:
  float Value(int x, int y) const;
  float Smooth(float x, float y) const;
  std::uint32_t seed_;
};

}  // namespace pliant::simulation
