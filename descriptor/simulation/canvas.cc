// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/canvas.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace pliant::simulation {
namespace {

// Each glyph: strokes over a grid 4 wide and 6 high (y upwards), as pairs of digits; a space lifts
// the pen. Drawn by hand for this project.
struct Glyph {
  char letter;
  std::string_view strokes;
};
constexpr std::array kGlyphs = std::to_array<Glyph>({
    {'A', "002640 1232"},
    {'B', "00063645443303 3342413000"},
    {'C', "45361605011030 3041"},
    {'D', "00062644412000"},
    {'E', "40000646 0333"},
    {'F', "000646 0333"},
    {'G', "453616050110304143 4323"},
    {'H', "0006 4046 0343"},
    {'I', "2026 1030 1636"},
    {'J', "464130100102"},
    {'K', "0006 4602 1340"},
    {'L', "060040"},
    {'M', "0006234640"},
    {'N', "00064046"},
    {'O', "1001051636454130 3010"},
    {'P', "0006364544330303"},
    {'Q', "1001051636454130 3010 2240"},
    {'R', "00063645443303 2340"},
    {'S', "45361605041343 34 4341301001"},
    {'T', "2026 0646"},
    {'U', "060110304146"},
    {'V', "062046"},
    {'W', "0610233046"},
    {'X', "0046 0640"},
    {'Y', "062346 2320"},
    {'Z', "06460040"},
    {'0', "1001051636454130 3010 0145"},
    {'1', "052620 1030"},
    {'2', "051636454400 0040"},
    {'3', "0516364544332333 33423110 1001"},
    {'4', "30360242"},
    {'5', "46060333424130100001"},
    {'6', "45361605011030414233 3303"},
    {'7', "064610"},
    {'8', "1304051636454433 3313 1302011030414233"},
    {'9', "43130405163645413010"},
    {'.', "2021"},
    {',', "2110"},
    {'-', "1333"},
    {'!', "2021 2326"},
    {'&', "4014051626353401001030 3042"},
    {'%', "0046 0506 4041"},
    {'/', "0046"},
    {':', "2122 2425"},
});

std::string_view StrokesOf(char letter) {
  const auto upper =
      static_cast<char>(letter >= 'a' && letter <= 'z' ? letter - 'a' + 'A' : letter);
  const auto* found = std::ranges::find(kGlyphs, upper, &Glyph::letter);
  return found == kGlyphs.end() ? std::string_view() : found->strokes;
}

float DistanceToSegment(const Point& p, const Point& from, const Point& to) {
  const Point axis = to - from;
  const float length = axis.square().sum();
  const float t = length > 0.0F ? std::clamp(((p - from) * axis).sum() / length, 0.0F, 1.0F) : 0.0F;
  return std::sqrt((p - from - t * axis).square().sum());
}

}  // namespace

Canvas::Canvas(int width, int height, const Ink& paper)
    : width_(width), height_(height), pixels_(static_cast<std::size_t>(width) * height, paper) {}

template <typename Distance>
void Canvas::Fill(const Point& low, const Point& high, const Ink& ink, float opacity,
                  Distance&& distance) {
  const int x0 = std::max(0, static_cast<int>(std::floor(low.x() - 1.0F)));
  const int y0 = std::max(0, static_cast<int>(std::floor(low.y() - 1.0F)));
  const int x1 = std::min(width_ - 1, static_cast<int>(std::ceil(high.x() + 1.0F)));
  const int y1 = std::min(height_ - 1, static_cast<int>(std::ceil(high.y() + 1.0F)));
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const float cover = std::clamp(
          0.5F - distance(Point(static_cast<float>(x), static_cast<float>(y))), 0.0F, 1.0F);
      if (cover > 0.0F) At(x, y) += opacity * cover * (ink - At(x, y));
    }
  }
}

void Canvas::Rectangle(const Point& low, const Point& high, const Ink& ink, float opacity) {
  const Point centre = 0.5F * (low + high);
  const Point half = 0.5F * (high - low);
  Fill(low, high, ink, opacity,
       [&](const Point& p) { return ((p - centre).abs() - half).maxCoeff(); });
}

void Canvas::Ellipse(const Point& centre, const Point& radii, float angle, const Ink& ink,
                     float taper) {
  const float reach = radii.maxCoeff();
  const float c = std::cos(angle);
  const float s = std::sin(angle);
  Fill(centre - reach, centre + reach, ink, 1.0F, [&](const Point& p) {
    const Point d = p - centre;
    const Point local((c * d.x() + s * d.y()) / radii.x(), (c * d.y() - s * d.x()) / radii.y());
    const float narrow = std::max(0.05F, 1.0F - taper * local.x());
    const float norm = std::hypot(local.x(), local.y() / narrow);
    return (norm - 1.0F) * radii.minCoeff();
  });
}

void Canvas::Line(const Point& from, const Point& to, float thickness, const Ink& ink) {
  const float radius = 0.5F * thickness;
  Fill(from.min(to) - radius, from.max(to) + radius, ink, 1.0F,
       [&](const Point& p) { return DistanceToSegment(p, from, to) - radius; });
}

void Canvas::Ring(const Point& centre, float radius, float thickness, const Ink& ink) {
  Fill(centre - radius - thickness, centre + radius + thickness, ink, 1.0F, [&](const Point& p) {
    return std::abs(std::sqrt((p - centre).square().sum()) - radius) - 0.5F * thickness;
  });
}

void Canvas::Polygon(const std::vector<Point>& corners, const Ink& ink) {
  Point low = corners.front();
  Point high = low;
  for (const Point& corner : corners) {
    low = low.min(corner);
    high = high.max(corner);
  }
  Fill(low, high, ink, 1.0F, [&](const Point& p) {
    float nearest = 1e9F;
    bool inside = false;
    for (std::size_t i = 0, j = corners.size() - 1; i < corners.size(); j = i++) {
      const Point& a = corners[i];
      const Point& b = corners[j];
      nearest = std::min(nearest, DistanceToSegment(p, a, b));
      if ((a.y() > p.y()) != (b.y() > p.y()) &&
          p.x() < (b.x() - a.x()) * (p.y() - a.y()) / (b.y() - a.y()) + a.x()) {
        inside = !inside;
      }
    }
    return inside ? -nearest : nearest;
  });
}

float Canvas::Text(std::string_view text, const Point& baseline_left, float letter_height,
                   float thickness, const Ink& ink, float slant) {
  const float unit = letter_height / 6.0F;
  const float advance = 4.0F * unit + 1.5F * unit + thickness;
  Point pen = baseline_left;
  for (const char letter : text) {
    bool down = false;
    Point last = pen;
    const std::string_view strokes = StrokesOf(letter);
    for (std::size_t i = 0; i + 1 < strokes.size();) {
      if (strokes[i] == ' ') {
        down = false;
        ++i;
        continue;
      }
      const auto column = static_cast<float>(strokes[i] - '0');
      const auto row = static_cast<float>(strokes[i + 1] - '0');
      const Point next = pen + Point((column + slant * row) * unit, -row * unit);
      if (down) Line(last, next, thickness, ink);
      last = next;
      down = true;
      i += 2;
    }
    pen.x() += advance;
  }
  return pen.x() - baseline_left.x();
}

Image Canvas::ToImage() const {
  Image image{width_, height_, 3, {}};
  image.pixels.reserve(3 * pixels_.size());
  for (const Ink& ink : pixels_) {
    for (int c = 0; c < 3; ++c) {
      image.pixels.push_back(ToByte(ink[c] * 255.0F));
    }
  }
  return image;
}

Noise::Noise(Random& random) : seed_(random.Next()) {}

float Noise::Value(int x, int y) const {
  std::uint32_t h = seed_ ^ (static_cast<std::uint32_t>(x) * 0x9E3779B1U) ^
                    (static_cast<std::uint32_t>(y) * 0x85EBCA77U);
  h = (h ^ (h >> 15U)) * 0x2C1B3C6DU;
  h = (h ^ (h >> 12U)) * 0x297A2D39U;
  return static_cast<float>((h ^ (h >> 15U)) >> 8U) * 0x1p-24F;
}

float Noise::Smooth(float x, float y) const {
  const int x0 = static_cast<int>(std::floor(x));
  const int y0 = static_cast<int>(std::floor(y));
  const auto ease = [](float t) { return t * t * (3.0F - 2.0F * t); };
  const float fx = ease(x - static_cast<float>(x0));
  const float fy = ease(y - static_cast<float>(y0));
  const float top = std::lerp(Value(x0, y0), Value(x0 + 1, y0), fx);
  const float bottom = std::lerp(Value(x0, y0 + 1), Value(x0 + 1, y0 + 1), fx);
  return std::lerp(top, bottom, fy);
}

float Noise::At(float x, float y, int octaves) const {
  float sum = 0.0F;
  float weight = 0.5F;
  float total = 0.0F;
  for (int i = 0; i < octaves; ++i) {
    sum += weight * Smooth(x, y);
    total += weight;
    x = 2.0F * x + 17.3F;
    y = 2.0F * y + 5.7F;
    weight *= 0.5F;
  }
  return sum / total;
}

}  // namespace pliant::simulation
