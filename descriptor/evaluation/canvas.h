// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Lines, boxes and words on a white sheet, drawn twice as large and scaled down. Internal to this
// room.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include <opencv2/core.hpp>

#include "descriptor/image.h"
#include "descriptor/tps.h"

namespace pliant::evaluation {

using Colour = std::array<std::uint8_t, 3>;  // red, green, blue

inline constexpr Colour kBlack = {30, 30, 30};
inline constexpr Colour kGrey = {140, 140, 140};
inline constexpr Colour kPale = {225, 225, 225};

// Colours that can be told apart side by side; they repeat after the tenth.
Colour SeriesColour(std::size_t series);

enum class Align { kLeft, kCentre, kRight };

class Canvas {
 public:
  Canvas(int width, int height);

  void Line(Vec2 from, Vec2 to, const Colour& colour, double thickness = 1.0);
  void Box(Vec2 low, Vec2 high, const Colour& colour);
  void Disc(Vec2 centre, double radius, const Colour& colour);
  void Ring(Vec2 centre, double radius, const Colour& colour, double thickness = 1.0);
  // ASCII letters `height` pixels high; `at` is the left, middle or right end of the base line.
  void Text(const std::string& text, Vec2 at, double height, const Colour& colour = kBlack,
            Align align = Align::kLeft);
  static double TextWidth(const std::string& text, double height);
  // Lays a picture (1 or 3 channels) over the sheet.
  void Paste(const Image& picture, int x, int y);

  Image ToImage() const;  // 3 channels

 private:
  cv::Mat sheet_;  // twice the size, R G B
};

}  // namespace pliant::evaluation
