// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/match_drawing.h"

#include <algorithm>
#include <array>
#include <utility>

#include "descriptor/evaluation/canvas.h"

namespace pliant::evaluation {
namespace {

constexpr int kGap = 8;
constexpr int kCaptionHeight = 30;
constexpr Colour kYellow = {250, 210, 40};

// What matters most is drawn last.
constexpr std::array<std::pair<Verdict, Colour>, 3> kOrder = {{{Verdict::kUnknown, {70, 140, 235}},
                                                               {Verdict::kFalse, {225, 45, 45}},
                                                               {Verdict::kTrue, {40, 200, 80}}}};

}  // namespace

Image DrawMatches(const Image& first, const Image& second, std::span<const DrawnMatch> matches,
                  std::span<const Vec2> outline, const std::string& caption) {
  const int height = std::max(first.height, second.height);
  const int offset = first.width + kGap;
  Canvas canvas(offset + second.width, height + kCaptionHeight);
  canvas.Paste(first, 0, 0);
  canvas.Paste(second, offset, 0);
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Vec2& a = outline[i];
    const Vec2& b = outline[(i + 1) % outline.size()];
    canvas.Line({a.x + offset, a.y}, {b.x + offset, b.y}, kYellow, 2.0);
  }
  for (const auto& [verdict, colour] : kOrder) {
    for (const DrawnMatch& match : matches) {
      if (match.verdict != verdict) continue;
      const Vec2 end{match.second.x + offset, match.second.y};
      canvas.Line(match.first, end, colour, 0.5);
      canvas.Ring(match.first, 2.5, colour);
      canvas.Ring(end, 2.5, colour);
    }
  }
  canvas.Box({0.0, height - 0.5},
             {static_cast<double>(offset + second.width), height + kCaptionHeight - 0.5},
             {255, 255, 255});
  canvas.Text(caption, {10, height + 20.0}, 11);
  return canvas.ToImage();
}

}  // namespace pliant::evaluation
