// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/drawing/drawing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <mutex>
#include <string_view>
#include <vector>

#include <opencv2/imgproc.hpp>
#include <pango/pangoft2.h>

#include "descriptor/base/error.h"
#include "descriptor/base/utf8.h"
#include "descriptor/image/cv_image.h"

namespace pliant {
namespace {

constexpr int kShift = 4;  // OpenCV draws in sixteenths of a pixel
// Beyond it a coordinate is cut off: it would not fit OpenCV's fixed-point numbers.
constexpr double kFarthest = 1e5;

cv::Mat Canvas(Image& image) {
  if (image.channels != 3 || image.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "not_colour",
                "Drawing needs an image with 3 channels and at least one pixel");
  }
  return ViewAsMat(image);
}

cv::Scalar ToScalar(Colour colour) { return cv::Scalar(colour.red, colour.green, colour.blue); }

cv::Point ToFixed(Vec2 p) {
  const auto fixed = [](double value) {
    const double near = std::isnan(value) ? kFarthest : std::clamp(value, -kFarthest, kFarthest);
    return static_cast<int>(std::lround(near * (1 << kShift)));
  };
  return {fixed(p.x), fixed(p.y)};
}

std::vector<cv::Point> ToFixed(std::span<const Vec2> points) {
  std::vector<cv::Point> fixed;
  fixed.reserve(points.size());
  for (const Vec2 p : points) fixed.push_back(ToFixed(p));
  return fixed;
}

// One line of text, drawn: how much of each pixel is ink.
struct Lettering {
  int left = 0, top = 0;  // of the first pixel, from the left end of the baseline; y points down
  int width = 0, height = 0;
  int advance = 0;                // length of the line; ink can reach a little beyond
  std::vector<std::uint8_t> ink;  // height x width, row-major; 255 = covered
};

constexpr std::size_t kMaxLetters = 4096;  // the rest of a text is dropped
constexpr double kCapitalPerEm = 0.72;     // of usual fonts without serifs (DejaVu Sans: 0.729)
constexpr int kMargin_px = 1;              // around the ink, which Pango rounds

struct Unref {
  void operator()(void* object) const { g_object_unref(object); }
};
struct FreeFont {
  void operator()(PangoFontDescription* font) const { pango_font_description_free(font); }
};
using Layout = std::unique_ptr<PangoLayout, Unref>;
using Font = std::unique_ptr<PangoFontDescription, FreeFont>;

// Pango's fonts are for one thread at a time. Never destroyed: threads can draw while the program
// ends.
std::mutex& Turn() {
  static auto* const turn = new std::mutex;
  return *turn;
}

PangoContext* System() {
  static PangoContext* const context = pango_font_map_create_context(pango_ft2_font_map_new());
  return context;
}

Font SansSerif(int height_px) {
  Font font(pango_font_description_from_string("sans-serif"));
  pango_font_description_set_absolute_size(font.get(), PANGO_SCALE * height_px / kCapitalPerEm);
  return font;
}

std::string Drawable(std::string_view utf8) {
  std::u32string text = DecodeUtf8(utf8.substr(0, 4 * kMaxLetters));
  if (text.size() > kMaxLetters) text.resize(kMaxLetters);
  for (char32_t& point : text) {
    if (point < 0x20 || (point >= 0x7F && point < 0xA0)) point = U'\uFFFD';
  }
  return EncodeUtf8(text);
}

// Laid out by Pango: any script for which a font is installed, right to left where the script is.
Lettering DrawLetters(std::string_view text, int height_px) {
  const std::lock_guard lock(Turn());
  const Layout layout(pango_layout_new(System()));
  const std::string drawable = Drawable(text);
  pango_layout_set_font_description(layout.get(), SansSerif(height_px).get());
  pango_layout_set_single_paragraph_mode(layout.get(), TRUE);
  pango_layout_set_text(layout.get(), drawable.data(), static_cast<int>(drawable.size()));
  PangoLayoutLine* const line = pango_layout_get_line_readonly(layout.get(), 0);
  PangoRectangle ink{};
  PangoRectangle logical{};
  pango_layout_line_get_pixel_extents(line, &ink, &logical);
  Lettering letters;
  letters.advance = logical.width;
  if (ink.width <= 0 || ink.height <= 0) return letters;
  letters.left = ink.x - kMargin_px;
  letters.top = ink.y - kMargin_px;
  letters.width = ink.width + 2 * kMargin_px;
  letters.height = ink.height + 2 * kMargin_px;
  letters.ink.resize(static_cast<std::size_t>(letters.width) * letters.height);
  FT_Bitmap bitmap{};
  bitmap.rows = static_cast<unsigned>(letters.height);
  bitmap.width = static_cast<unsigned>(letters.width);
  bitmap.pitch = letters.width;
  bitmap.buffer = letters.ink.data();
  bitmap.num_grays = 256;
  bitmap.pixel_mode = FT_PIXEL_MODE_GRAY;
  pango_ft2_render_layout_line(&bitmap, line, -letters.left, -letters.top);
  return letters;
}

void Blend(Image& on, const Lettering& letters, int left, int baseline, Colour colour) {
  const std::int64_t x0 = std::int64_t{left} + letters.left;
  const std::int64_t y0 = std::int64_t{baseline} + letters.top;
  const std::uint8_t rgb[] = {colour.red, colour.green, colour.blue};
  for (int row = 0; row < letters.height; ++row) {
    if (y0 + row < 0 || y0 + row >= on.height) continue;
    for (int column = 0; column < letters.width; ++column) {
      if (x0 + column < 0 || x0 + column >= on.width) continue;
      const int ink = letters.ink[static_cast<std::size_t>(row) * letters.width + column];
      std::uint8_t* pixel =
          &on.pixels[static_cast<std::size_t>(3 * ((y0 + row) * on.width + x0 + column))];
      for (int c = 0; c < 3; ++c) {
        pixel[c] = static_cast<std::uint8_t>((pixel[c] * (255 - ink) + rgb[c] * ink + 127) / 255);
      }
    }
  }
}

}  // namespace

bool HasFonts() {
  const std::lock_guard lock(Turn());
  static const bool has = [] {
    const std::unique_ptr<PangoFont, Unref> font(
        pango_context_load_font(System(), SansSerif(10).get()));
    return font != nullptr;
  }();
  return has;
}

Colour DistinctColour(std::size_t i) {
  static constexpr std::array kColours = {
      Colour{31, 119, 180},  Colour{235, 100, 20},  Colour{44, 160, 44},
      Colour{214, 39, 40},   Colour{148, 103, 189}, Colour{140, 86, 75},
      Colour{227, 119, 194}, Colour{120, 120, 120}, Colour{180, 180, 30}};
  return kColours[i % kColours.size()];
}

Image BlankImage(int width, int height, Colour colour) {
  if (width < 1 || height < 1) {
    throw Error(ErrorCode::kInvalidArgument, "bad_size",
                "An image of " + std::to_string(width) + " x " + std::to_string(height) +
                    " pixels cannot be made");
  }
  return CopyFromMat(cv::Mat(height, width, CV_8UC3, ToScalar(colour)));
}

Image ToColour(const Image& image) {
  if (image.channels == 3) return image;
  cv::Mat colour;
  cv::cvtColor(ViewAsMat(image), colour, cv::COLOR_GRAY2RGB);
  return CopyFromMat(colour);
}

void DrawLine(Image& on, Vec2 from, Vec2 to, Colour colour, int thickness_px) {
  cv::Mat canvas = Canvas(on);
  cv::line(canvas, ToFixed(from), ToFixed(to), ToScalar(colour), thickness_px, cv::LINE_AA, kShift);
}

void DrawPolyline(Image& on, std::span<const Vec2> points, bool closed, Colour colour,
                  int thickness_px) {
  cv::Mat canvas = Canvas(on);
  if (points.empty()) return;
  cv::polylines(canvas, ToFixed(points), closed, ToScalar(colour), thickness_px, cv::LINE_AA,
                kShift);
}

void DrawDot(Image& on, Vec2 centre, double radius_px, Colour colour) {
  cv::Mat canvas = Canvas(on);
  const int radius = std::max(1, static_cast<int>(std::lround(radius_px * (1 << kShift))));
  cv::circle(canvas, ToFixed(centre), radius, ToScalar(colour), cv::FILLED, cv::LINE_AA, kShift);
}

void FillBox(Image& on, int x, int y, int width, int height, Colour colour) {
  cv::Mat canvas = Canvas(on);
  const cv::Rect box = cv::Rect(x, y, width, height) & cv::Rect(0, 0, on.width, on.height);
  if (!box.empty()) canvas(box).setTo(ToScalar(colour));
}

void DrawText(Image& on, int left, int baseline, const std::string& text, Colour colour,
              int height_px) {
  Canvas(on);  // checks it
  if (HasFonts()) Blend(on, DrawLetters(text, height_px), left, baseline, colour);
}

int TextWidth(const std::string& text, int height_px) {
  return HasFonts() ? DrawLetters(text, height_px).advance : 0;
}

void PasteImage(Image& onto, const Image& what, int x, int y) {
  cv::Mat canvas = Canvas(onto);
  if (what.empty()) return;
  const cv::Rect place = cv::Rect(x, y, what.width, what.height);
  const cv::Rect seen = place & cv::Rect(0, 0, onto.width, onto.height);
  if (seen.empty()) return;
  const Image colour = ToColour(what);
  ViewAsMat(colour)(seen - place.tl()).copyTo(canvas(seen));
}

}  // namespace pliant
