// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/drawing/match_drawing.h"

#include <algorithm>
#include <array>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "descriptor/drawing/drawing.h"

namespace pliant {
namespace {

constexpr int kZoom = 2;  // drawn at twice the size and scaled down, so that thin lines are smooth
constexpr int kGap_px = 8;
constexpr int kLine_px = 20;  // height of a line of the caption
constexpr int kMargin_px = 10;
constexpr int kSwatch_px = 18;
constexpr int kLetters_px = 11;
constexpr int kLeastWidth_px = 320;  // of the caption
constexpr Colour kInk{30, 30, 30};

struct Kind {
  Verdict verdict;
  Colour colour;
  const char* name;
};

// What matters most is drawn last. Colours that people of any colour vision tell apart (Okabe and
// Ito, "Color Universal Design", 2008): reddish purple, orange, blue.
constexpr std::array<Kind, 3> kKinds = {{{Verdict::kUnknown, {204, 121, 167}, "match"},
                                         {Verdict::kFalse, {230, 159, 0}, "wrong match"},
                                         {Verdict::kTrue, {0, 114, 178}, "correct match"}}};

// A word of the caption, or an entry of the legend, and its place from the caption's top left.
struct Piece {
  std::string text;
  std::optional<Colour> swatch = {};
  int x = 0;
  int line = 0;
};

// Words, and entries of the legend below them, in lines that fit the width. Returns their number.
int Arrange(std::vector<Piece>& pieces, int width) {
  int x = kMargin_px;
  int line = 0;
  bool in_legend = false;
  for (Piece& piece : pieces) {
    const int swatch = piece.swatch ? kSwatch_px + 6 : 0;
    const int length = swatch + TextWidth(piece.text, kZoom * kLetters_px) / kZoom;
    const bool begins_legend = piece.swatch && !std::exchange(in_legend, piece.swatch.has_value());
    if (x > kMargin_px && (begins_legend || x + length > width - kMargin_px)) {
      x = kMargin_px;
      ++line;
    }
    piece.x = x;
    piece.line = line;
    x += length + (piece.swatch ? 18 : 5);
  }
  return line + 1;
}

std::vector<Piece> CaptionPieces(const std::string& caption, std::span<const DrawnMatch> matches,
                                 bool outlined) {
  std::vector<Piece> pieces;
  std::istringstream words(caption);
  for (std::string word; words >> word;) pieces.push_back({std::move(word)});
  for (const Kind& kind : kKinds) {
    const auto is_it = [&](const DrawnMatch& match) { return match.verdict == kind.verdict; };
    if (std::ranges::any_of(matches, is_it)) pieces.push_back({kind.name, kind.colour});
  }
  if (outlined) pieces.push_back({"outline of the first image", colours::kYellow});
  return pieces;
}

void DrawPieces(Image& sheet, const std::vector<Piece>& pieces, int top) {
  for (const Piece& piece : pieces) {
    const int baseline = top + kMargin_px / 2 + piece.line * kLine_px + 15;
    int x = piece.x;
    if (piece.swatch) {
      FillBox(sheet, kZoom * x, kZoom * (baseline - 7), kZoom * kSwatch_px, kZoom * 4,
              *piece.swatch);
      x += kSwatch_px + 6;
    }
    DrawText(sheet, kZoom * x, kZoom * baseline, piece.text, kInk, kZoom * kLetters_px);
  }
}

Vec2 Zoomed(Vec2 p) { return {(p.x + 0.5) * kZoom - 0.5, (p.y + 0.5) * kZoom - 0.5}; }

Image ZoomedImage(const Image& image) {
  return ToColour(ResizeImage(image, kZoom * image.width, kZoom * image.height));
}

}  // namespace

Image DrawMatches(const Image& first, const Image& second, std::span<const DrawnMatch> matches,
                  std::span<const Vec2> outline, const std::string& caption) {
  const int height = std::max(first.height, second.height);
  const int offset = first.width + kGap_px;
  const int width = std::max(offset + second.width, kLeastWidth_px);
  std::vector<Piece> pieces = CaptionPieces(caption, matches, !outline.empty());
  const int caption_height = Arrange(pieces, width) * kLine_px + kMargin_px;
  Image right = ZoomedImage(second);
  std::vector<Vec2> corners;
  for (const Vec2 p : outline) corners.push_back(Zoomed(p));
  DrawPolyline(right, corners, true, colours::kYellow, 2 * kZoom);
  Image sheet = BlankImage(kZoom * width, kZoom * (height + caption_height), colours::kWhite);
  PasteImage(sheet, ZoomedImage(first), 0, 0);
  PasteImage(sheet, right, kZoom * offset, 0);
  for (const Kind& kind : kKinds) {
    for (const DrawnMatch& match : matches) {
      if (match.verdict != kind.verdict) continue;
      const Vec2 from = Zoomed(match.first);
      const Vec2 to = Zoomed(Vec2{match.second.x + offset, match.second.y});
      DrawLine(sheet, from, to, kind.colour);
      DrawDot(sheet, from, 1.8 * kZoom, kind.colour);
      DrawDot(sheet, to, 1.8 * kZoom, kind.colour);
    }
  }
  FillBox(sheet, 0, kZoom * height, kZoom * width, kZoom * caption_height, colours::kWhite);
  DrawPieces(sheet, pieces, height);
  return ResizeImage(sheet, width, height + caption_height);
}

}  // namespace pliant
