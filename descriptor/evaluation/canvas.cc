// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/canvas.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "descriptor/cv_image.h"

namespace pliant::evaluation {
namespace {

constexpr int kOversampling = 2;
constexpr int kShift = 4;  // fractional bits of positions
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr double kFontHeight = 21.0;  // capital letters of that font at scale 1

// OpenCV's fixed-point position on the large sheet.
cv::Point Fixed(Vec2 p) {
  const auto to_fixed = [](double v) {
    const double on_sheet = (v + 0.5) * kOversampling - 0.5;
    return static_cast<int>(std::lround(std::clamp(on_sheet, -1e6, 1e6) * (1 << kShift)));
  };
  return {to_fixed(p.x), to_fixed(p.y)};
}

cv::Scalar ToScalar(const Colour& c) { return {double(c[0]), double(c[1]), double(c[2])}; }

int Thick(double thickness) {
  return std::max(1, static_cast<int>(std::lround(thickness * kOversampling)));
}

double FontScale(double height) { return height * kOversampling / kFontHeight; }

// Strokes as heavy as the letters are high.
int FontWeight(double height) { return std::max(1, static_cast<int>(std::lround(height / 5.5))); }

}  // namespace

Colour SeriesColour(std::size_t series) {
  static constexpr std::array<Colour, 10> kColours = {{{213, 62, 30},
                                                       {244, 150, 60},
                                                       {31, 119, 180},
                                                       {120, 180, 225},
                                                       {44, 140, 60},
                                                       {130, 90, 170},
                                                       {140, 86, 75},
                                                       {220, 110, 180},
                                                       {110, 110, 110},
                                                       {170, 170, 40}}};
  return kColours[series % kColours.size()];
}

Canvas::Canvas(int width, int height)
    : sheet_(height * kOversampling, width * kOversampling, CV_8UC3, cv::Scalar::all(255)) {}

void Canvas::Line(Vec2 from, Vec2 to, const Colour& colour, double thickness) {
  cv::line(sheet_, Fixed(from), Fixed(to), ToScalar(colour), Thick(thickness), cv::LINE_AA, kShift);
}

void Canvas::Box(Vec2 low, Vec2 high, const Colour& colour) {
  cv::rectangle(sheet_, Fixed(low), Fixed(high), ToScalar(colour), cv::FILLED, cv::LINE_AA, kShift);
}

void Canvas::Disc(Vec2 centre, double radius, const Colour& colour) {
  const int fixed_radius = static_cast<int>(std::lround(radius * kOversampling * (1 << kShift)));
  cv::circle(sheet_, Fixed(centre), fixed_radius, ToScalar(colour), cv::FILLED, cv::LINE_AA,
             kShift);
}

void Canvas::Ring(Vec2 centre, double radius, const Colour& colour, double thickness) {
  const int fixed_radius = static_cast<int>(std::lround(radius * kOversampling * (1 << kShift)));
  cv::circle(sheet_, Fixed(centre), fixed_radius, ToScalar(colour), Thick(thickness), cv::LINE_AA,
             kShift);
}

void Canvas::Text(const std::string& text, Vec2 at, double height, const Colour& colour,
                  Align align) {
  const double share = align == Align::kLeft ? 0.0 : align == Align::kCentre ? 0.5 : 1.0;
  const cv::Point origin(
      static_cast<int>(std::lround((at.x - share * TextWidth(text, height)) * kOversampling)),
      static_cast<int>(std::lround(at.y * kOversampling)));
  cv::putText(sheet_, text, origin, kFont, FontScale(height), ToScalar(colour), FontWeight(height),
              cv::LINE_AA);
}

double Canvas::TextWidth(const std::string& text, double height) {
  int below = 0;
  const cv::Size size = cv::getTextSize(text, kFont, FontScale(height), FontWeight(height), &below);
  return static_cast<double>(size.width) / kOversampling;
}

void Canvas::Paste(const Image& picture, int x, int y) {
  cv::Mat colour = ViewAsMat(picture);
  if (picture.channels == 1) cv::cvtColor(colour, colour, cv::COLOR_GRAY2RGB);
  cv::Mat large;
  cv::resize(colour, large, {}, kOversampling, kOversampling, cv::INTER_LINEAR);
  const cv::Rect place(x * kOversampling, y * kOversampling, large.cols, large.rows);
  const cv::Rect inside = place & cv::Rect(0, 0, sheet_.cols, sheet_.rows);
  if (inside.empty()) return;
  large(inside - place.tl()).copyTo(sheet_(inside));
}

Image Canvas::ToImage() const {
  cv::Mat small;
  cv::resize(sheet_, small, {sheet_.cols / kOversampling, sheet_.rows / kOversampling}, 0, 0,
             cv::INTER_AREA);
  return CopyFromMat(small);
}

}  // namespace pliant::evaluation
