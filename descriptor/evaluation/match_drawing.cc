// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/match_drawing.h"

#include <algorithm>
#include <array>
#include <utility>

#include "descriptor/plot/sheet.h"

namespace pliant::evaluation {
namespace {

constexpr int kGap = 8;
constexpr int kCaptionHeight = 30;

// What matters most is drawn last.
constexpr std::array<std::pair<Verdict, Colour>, 3> kOrder = {{{Verdict::kUnknown, colours::kBlue},
                                                               {Verdict::kFalse, colours::kRed},
                                                               {Verdict::kTrue, colours::kGreen}}};

}  // namespace

Image DrawMatches(const Image& first, const Image& second, std::span<const DrawnMatch> matches,
                  std::span<const Vec2> outline, const std::string& caption) {
  const int height = std::max(first.height, second.height);
  const int offset = first.width + kGap;
  plot::Sheet sheet(offset + second.width, height + kCaptionHeight);
  sheet.Paste(second, offset, 0);
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Vec2& a = outline[i];
    const Vec2& b = outline[(i + 1) % outline.size()];
    sheet.Line({a.x + offset, a.y}, {b.x + offset, b.y}, colours::kYellow, 2.0);
  }
  // What of the outline lies left of its picture goes.
  sheet.Box({0.0, 0.0}, {static_cast<double>(offset), static_cast<double>(height)},
            colours::kWhite);
  sheet.Paste(first, 0, 0);
  for (const auto& [verdict, colour] : kOrder) {
    for (const DrawnMatch& match : matches) {
      if (match.verdict != verdict) continue;
      const Vec2 end{match.second.x + offset, match.second.y};
      sheet.Line(match.first, end, colour, 0.5);
      sheet.Disc(match.first, 1.8, colour);
      sheet.Disc(end, 1.8, colour);
    }
  }
  const double bottom = height;
  sheet.Box({0.0, bottom}, {static_cast<double>(offset + second.width), bottom + kCaptionHeight},
            colours::kWhite);
  sheet.Text(caption, {10, height + 20.0}, 11);
  return sheet.Finish();
}

}  // namespace pliant::evaluation
