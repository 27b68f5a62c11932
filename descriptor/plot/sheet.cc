// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/plot/sheet.h"

#include <algorithm>
#include <cmath>

namespace pliant::plot {

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

void Sheet::Marker(std::size_t shape, Vec2 centre, double radius, Colour colour) {
  const double r = kZoom * radius;
  const Vec2 c = Zoomed(centre);
  const double half = 0.89 * r;  // of a square of the disc's area; the others likewise
  const double corner = 1.25 * r;
  const Vec2 square[] = {{c.x - half, c.y - half},
                         {c.x + half, c.y - half},
                         {c.x + half, c.y + half},
                         {c.x - half, c.y + half}};
  const Vec2 diamond[] = {
      {c.x, c.y - corner}, {c.x + corner, c.y}, {c.x, c.y + corner}, {c.x - corner, c.y}};
  const Vec2 triangle[] = {
      {c.x, c.y - 1.55 * r}, {c.x + 1.35 * r, c.y + 0.78 * r}, {c.x - 1.35 * r, c.y + 0.78 * r}};
  switch (shape % 4) {
    case 0:
      return DrawDot(large_, c, r, colour);
    case 1:
      return FillConvex(large_, square, colour);
    case 2:
      return FillConvex(large_, diamond, colour);
    default:
      return FillConvex(large_, triangle, colour);
  }
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

std::string Sheet::Shortened(const std::string& text, double width, int height) {
  if (TextWidth(text, height) <= width) return text;
  std::string cut = text;
  const auto continues = [](char c) { return (static_cast<unsigned char>(c) & 0xC0) == 0x80; };
  while (!cut.empty() && TextWidth(cut + "...", height) > width) {
    while (cut.size() > 1 && continues(cut.back())) cut.pop_back();  // whole characters
    cut.pop_back();
  }
  return cut + "...";
}

}  // namespace pliant::plot
