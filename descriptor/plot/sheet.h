// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A white sheet for charts, drawn at twice the size with descriptor/plot/drawing.h and scaled down,
// which makes thin lines and small letters smooth. Positions and sizes refer to the final size.
#pragma once

#include <string>

#include "descriptor/plot/drawing.h"

namespace pliant::plot {

inline constexpr Colour kInk{30, 30, 30};
inline constexpr Colour kFaint{225, 225, 225};

enum class Align { kLeft, kCentre, kRight };

class Sheet {
 public:
  Sheet(int width, int height)
      : large_(BlankPicture(kZoom * width, kZoom * height, colours::kWhite)) {}

  void Line(Vec2 from, Vec2 to, Colour colour, double thickness = 1.0);
  void Box(Vec2 low, Vec2 high, Colour colour);
  void Disc(Vec2 centre, double radius, Colour colour);
  // A disc, square, diamond or triangle with the area of a disc of this radius; `shape` is cyclic.
  void Marker(std::size_t shape, Vec2 centre, double radius, Colour colour);
  void Paste(const Image& picture, int x, int y);
  // `at`: the left end, middle or right end of the base line.
  void Text(const std::string& text, Vec2 at, int height, Colour colour = kInk,
            Align align = Align::kLeft);
  static double TextWidth(const std::string& text, int height);
  // The text, or its beginning and "..." where it is wider than that.
  static std::string Shortened(const std::string& text, double width, int height);

  Image Finish() const { return ResizeImage(large_, large_.width / kZoom, large_.height / kZoom); }

 private:
  static constexpr int kZoom = 2;
  static Vec2 Zoomed(Vec2 p) { return {(p.x + 0.5) * kZoom - 0.5, (p.y + 0.5) * kZoom - 0.5}; }

  Image large_;
};

}  // namespace pliant::plot
