// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "descriptor/simulation/procedural_painters.h"

namespace pliant::simulation {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

void PaintBarcode(Canvas& canvas, Random& random, const Point& low, const Point& size) {
  canvas.Rectangle(low, low + size, Ink::Ones());
  float x = low.x() + 0.05F * size.x();
  while (x < low.x() + 0.95F * size.x()) {
    const float bar = size.x() * random.Uniform(0.008F, 0.035F);
    canvas.Rectangle({x, low.y() + 0.08F * size.y()}, {x + bar, low.y() + 0.8F * size.y()},
                     Ink::Zero());
    x += bar + size.x() * random.Uniform(0.008F, 0.035F);
  }
}

}  // namespace

void PaintNewspaper(Canvas& canvas, Random& random, const Palette&) {
  const auto w = static_cast<float>(canvas.width());
  const auto h = static_cast<float>(canvas.height());
  const Ink paper(0.93F, 0.91F, random.Uniform(0.8F, 0.9F));
  canvas.Rectangle({-1.0F, -1.0F}, {w, h}, paper);
  const Ink ink = Ink::Constant(random.Uniform(0.05F, 0.2F));
  const float title = h * random.Uniform(0.08F, 0.14F);
  canvas.Text(Word(random, 6, 10), {0.04F * w, 0.03F * h + title}, title, 0.15F * title, ink);
  float top = 0.06F * h + title;
  canvas.Line({0.03F * w, top}, {0.97F * w, top}, 2.0F, ink);
  const int columns = random.Integer(2, 5);
  const float column = 0.94F * w / static_cast<float>(columns);
  for (int c = 0; c < columns; ++c) {
    const float x = 0.03F * w + static_cast<float>(c) * column;
    float y = top + 0.02F * h;
    while (y < 0.95F * h) {
      const float headline = h * random.Uniform(0.022F, 0.05F);
      canvas.Text(Word(random, 3, 7), {x, y + headline}, headline, 0.17F * headline, ink);
      y += 1.5F * headline;
      if (random.Chance(0.4F)) {
        const float height = h * random.Uniform(0.08F, 0.2F);
        const Point low(x, y);
        const Point high(x + 0.92F * column, std::min(0.96F * h, y + height));
        canvas.Rectangle(low, high, Ink::Constant(random.Uniform(0.3F, 0.7F)));
        for (int i = 0; i < 14; ++i) {
          const Point centre = low + (high - low) * Point(random.Uniform(), random.Uniform());
          canvas.Ellipse(centre,
                         {0.18F * column * random.Uniform(), 0.12F * column * random.Uniform()},
                         random.Angle(), Ink::Constant(random.Uniform(0.1F, 0.9F)));
        }
        y = high.y() + 0.015F * h;
      }
      y = Column(canvas, random, {x, y}, 0.92F * column,
                 std::min(0.97F * h, y + h * random.Uniform(0.1F, 0.35F)), h * 0.0105F, ink) +
          0.012F * h;
    }
  }
}

void PaintPackaging(Canvas& canvas, Random& random, const Palette& palette) {
  const auto w = static_cast<float>(canvas.width());
  const auto h = static_cast<float>(canvas.height());
  const int rays = random.Integer(0, 1) * random.Integer(8, 24);
  const Point sun = AnyPoint(canvas, random);
  const Ink ray = palette.Any(random);
  for (int i = 0; i < rays; ++i) {
    const float a = 2.0F * kPi * static_cast<float>(i) / static_cast<float>(rays);
    const float b = a + kPi / static_cast<float>(rays);
    canvas.Polygon({sun, sun + 2.0F * w * Point(std::cos(a), std::sin(a)),
                    sun + 2.0F * w * Point(std::cos(b), std::sin(b))},
                   ray);
  }
  for (int i = random.Integer(1, 3); i > 0; --i) {
    const float y = h * random.Uniform();
    canvas.Rectangle({0.0F, y}, {w, y + h * random.Uniform(0.05F, 0.3F)}, palette.Any(random));
  }
  for (int i = random.Integer(3, 9); i > 0; --i)
    DrawShape(canvas, random, AnyPoint(canvas, random), h * random.LogUniform(0.03F, 0.2F),
              palette.Any(random));
  const float brand = h * random.Uniform(0.12F, 0.22F);
  const Point at(w * random.Uniform(0.03F, 0.15F), h * random.Uniform(0.3F, 0.7F));
  const std::string name = Word(random, 4, 7);
  canvas.Text(name, at + 0.03F * brand, brand, 0.26F * brand, palette.dark, 0.1F);
  canvas.Text(name, at, brand, 0.15F * brand, palette.paper, 0.1F);
  canvas.Text(Word(random, 4, 9) + " " + Word(random, 3, 8), at + Point(0.0F, 0.6F * brand),
              0.3F * brand, 0.05F * brand, palette.dark);
  const Point table(w * random.Uniform(0.55F, 0.7F), h * random.Uniform(0.05F, 0.55F));
  canvas.Rectangle(table, table + Point(0.27F * w, 0.36F * h), palette.paper);
  Column(canvas, random, table + 0.01F * w, 0.24F * w, table.y() + 0.34F * h, 0.014F * h,
         palette.dark);
  PaintBarcode(canvas, random, {w * random.Uniform(0.02F, 0.4F), h * random.Uniform(0.75F, 0.82F)},
               {0.2F * w, 0.16F * h});
}

void PaintMap(Canvas& canvas, Random& random, const Palette& palette) {
  const auto w = static_cast<float>(canvas.width());
  const Noise noise(random);
  const float scale = random.Uniform(3.0F, 7.0F) / w;
  const float sea = random.Uniform(0.38F, 0.5F);
  const Ink water(0.62F, 0.78F, 0.9F);
  const Ink low(0.8F, 0.88F, 0.7F);
  const Ink high(0.78F, 0.66F, 0.5F);
  for (int y = 0; y < canvas.height(); ++y) {
    for (int x = 0; x < canvas.width(); ++x) {
      const float height =
          noise.At(static_cast<float>(x) * scale, static_cast<float>(y) * scale, 6);
      const float level = 24.0F * height;
      const float contour = std::abs(level - std::round(level));
      Ink ink = height < sea
                    ? water
                    : Ink(low + (high - low) * std::clamp((height - sea) * 3.0F, 0.0F, 1.0F));
      if (contour < 0.08F) ink *= 0.75F;
      canvas.At(x, y) = ink;
    }
  }
  std::vector<Point> towns;
  for (int i = random.Integer(12, 30); i > 0; --i) towns.push_back(AnyPoint(canvas, random));
  for (const Point& town : towns) {
    const Point& other =
        towns[static_cast<std::size_t>(random.Integer(0, static_cast<int>(towns.size()) - 1))];
    const Ink road = palette.Any(random);
    Point from = town;
    for (int step = 1; step <= 6; ++step) {
      const Point jitter(random.Normal(), random.Normal());
      const Point to = town + (other - town) * (static_cast<float>(step) / 6.0F) +
                       (step < 6 ? Point(0.012F * w * jitter) : Point(0.0F, 0.0F));
      canvas.Line(from, to, 0.004F * w, road);
      from = to;
    }
  }
  for (const Point& town : towns) {
    canvas.Ellipse(town, {0.007F * w, 0.007F * w}, 0.0F, Ink(0.8F, 0.15F, 0.1F));
    const float height = w * random.LogUniform(0.011F, 0.026F);
    canvas.Text(Word(random, 3, 9), town + Point(0.012F * w, 0.005F * w), height, 0.16F * height,
                Ink::Constant(0.1F));
  }
}

}  // namespace pliant::simulation
