// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/drawing/match_drawing.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "descriptor/drawing/drawing.h"

namespace pliant {
namespace {

constexpr int kZoom = 2;  // drawn at twice the size and scaled down, so that thin lines are smooth
constexpr int kGap_px = 8;
constexpr int kCaptionHeight_px = 30;
constexpr int kLetters_px = 11;
constexpr Colour kInk{30, 30, 30};

// What matters most is drawn last.
constexpr std::array<std::pair<Verdict, Colour>, 3> kOrder = {{{Verdict::kUnknown, colours::kBlue},
                                                               {Verdict::kFalse, colours::kRed},
                                                               {Verdict::kTrue, colours::kGreen}}};

Vec2 Zoomed(Vec2 p) { return {(p.x + 0.5) * kZoom - 0.5, (p.y + 0.5) * kZoom - 0.5}; }

Image ZoomedImage(const Image& image) {
  return ToColour(ResizeImage(image, kZoom * image.width, kZoom * image.height));
}

}  // namespace

Image DrawMatches(const Image& first, const Image& second, std::span<const DrawnMatch> matches,
                  std::span<const Vec2> outline, const std::string& caption) {
  const int height = std::max(first.height, second.height);
  const int offset = first.width + kGap_px;
  const int width = offset + second.width;
  Image right = ZoomedImage(second);
  std::vector<Vec2> corners;
  for (const Vec2 p : outline) corners.push_back(Zoomed(p));
  DrawPolyline(right, corners, true, colours::kYellow, 2 * kZoom);
  Image sheet = BlankImage(kZoom * width, kZoom * (height + kCaptionHeight_px), colours::kWhite);
  PasteImage(sheet, ZoomedImage(first), 0, 0);
  PasteImage(sheet, right, kZoom * offset, 0);
  for (const auto& [verdict, colour] : kOrder) {
    for (const DrawnMatch& match : matches) {
      if (match.verdict != verdict) continue;
      const Vec2 from = Zoomed(match.first);
      const Vec2 to = Zoomed(Vec2{match.second.x + offset, match.second.y});
      DrawLine(sheet, from, to, colour);
      DrawDot(sheet, from, 1.8 * kZoom, colour);
      DrawDot(sheet, to, 1.8 * kZoom, colour);
    }
  }
  FillBox(sheet, 0, kZoom * height, kZoom * width, kZoom * kCaptionHeight_px, colours::kWhite);
  DrawText(sheet, kZoom * 10, kZoom * (height + 20), caption, kInk, kZoom * kLetters_px);
  return ResizeImage(sheet, width, height + kCaptionHeight_px);
}

}  // namespace pliant
