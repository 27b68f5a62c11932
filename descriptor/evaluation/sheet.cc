// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/sheet.h"

#include <algorithm>
#include <cmath>

namespace pliant::evaluation {

void Sheet::Line(Vec2 from, Vec2 to, Colour colour, double thickness) {
  DrawLine(large_, Zoomed(from), Zoomed(to), colour,
           std::max(1, static_cast<int>(std::lround(kZoom * thickness))));
}

void Sheet::Box(Vec2 low, Vec2 high, Colour colour) {
  const int x = static_cast<int>(std::lround(kZoom * low.x));
  const int y = static_cast<int>(std::lround(kZoom * low.y));
  FillBox(large_, x, y, static_cast<int>(std::lround(kZoom * high.x)) - x,
          static_cast<int>(std::lround(kZoom * high.y)) - y, colour);
}

void Sheet::Disc(Vec2 centre, double radius, Colour colour) {
  DrawDot(large_, Zoomed(centre), kZoom * radius, colour);
}

void Sheet::Paste(const Image& picture, int x, int y) {
  PastePicture(large_, ResizeImage(picture, kZoom * picture.width, kZoom * picture.height),
               kZoom * x, kZoom * y);
}

void Sheet::Text(const std::string& text, Vec2 at, int height, Colour colour, Align align) {
  const double share = align == Align::kLeft ? 0.0 : align == Align::kCentre ? 0.5 : 1.0;
  const double left = kZoom * (at.x - share * TextWidth(text, height));
  DrawText(large_, static_cast<int>(std::lround(left)), static_cast<int>(std::lround(kZoom * at.y)),
           text, colour, kZoom * height);
}

double Sheet::TextWidth(const std::string& text, int height) {
  return static_cast<double>(pliant::TextWidth(text, kZoom * height)) / kZoom;
}

}  // namespace pliant::evaluation
