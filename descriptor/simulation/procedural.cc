// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/procedural.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string_view>
#include <utility>
#include <vector>

#include "descriptor/base/error.h"

namespace pliant::simulation {
namespace {

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

Ink FromHue(float hue, float saturation, float value) {
  const auto channel = [&](float shift) {
    const float t = std::fmod(hue * 6.0F + shift, 6.0F);
    return value * (1.0F - saturation * std::clamp(std::min(t, 4.0F - t), 0.0F, 1.0F));
  };
  return {channel(5.0F), channel(3.0F), channel(1.0F)};
}

Palette::Palette(Random& random) {
  const float hue = random.Uniform();
  for (std::size_t i = 0; i < inks_.size(); ++i) {
    const float turn =
        i % 2 == 0 ? random.Uniform(-0.08F, 0.08F) : 0.5F + random.Uniform(-0.12F, 0.12F);
    inks_[i] = FromHue(hue + 1.0F + turn, random.Uniform(0.15F, 0.9F), random.Uniform(0.2F, 1.0F));
  }
  paper = FromHue(hue, random.Uniform(0.0F, 0.2F), random.Uniform(0.8F, 1.0F));
  dark = FromHue(hue + 0.5F, random.Uniform(0.0F, 0.7F), random.Uniform(0.03F, 0.25F));
  if (random.Chance(0.25F)) std::swap(paper, dark);
}

const Ink& Palette::Any(Random& random) const { return inks_[random.Integer(0, 5)]; }

std::string Word(Random& random, int shortest, int longest) {
  constexpr std::string_view kConsonants = "BCDFGHJKLMNPRSTVWZ";
  constexpr std::string_view kVowels = "AEIOUY";
  std::string word;
  const int length = random.Integer(shortest, longest);
  bool vowel = random.Chance(0.4F);
  for (int i = 0; i < length; ++i) {
    const std::string_view from = vowel ? kVowels : kConsonants;
    word += from[random.Integer(0, static_cast<int>(from.size()) - 1)];
    vowel = random.Chance(0.85F) ? !vowel : vowel;
  }
  return word;
}

Point AnyPoint(const Canvas& canvas, Random& random) {
  const float x = random.Uniform(0.0F, static_cast<float>(canvas.width()));
  return {x, random.Uniform(0.0F, static_cast<float>(canvas.height()))};
}

void Mottle(Canvas& canvas, Random& random, float amount, float cells) {
  const Noise noise(random);
  const float scale = cells / static_cast<float>(canvas.width());
  for (int y = 0; y < canvas.height(); ++y) {
    for (int x = 0; x < canvas.width(); ++x) {
      canvas.At(x, y) *= 1.0F + amount * (noise.At(x * scale, y * scale, 4) - 0.5F);
    }
  }
}

float Column(Canvas& canvas, Random& random, const Point& top_left, float column_width,
             float bottom, float height, const Ink& ink) {
  float y = top_left.y() + height;
  while (y < bottom) {
    float x = top_left.x();
    const float end =
        top_left.x() + column_width * (random.Chance(0.12F) ? random.Uniform(0.3F, 0.9F) : 1.0F);
    while (x < end - 4.0F * height) {
      x += canvas.Text(Word(random, 2, 9), {x, y}, height, height * 0.16F, ink) + 0.7F * height;
    }
    y += height * 1.7F;
  }
  return y;
}

void DrawShape(Canvas& canvas, Random& random, const Point& centre, float size, const Ink& ink) {
  const int kind = random.Integer(0, 4);
  const float turn = random.Angle();
  if (kind == 0) {
    canvas.Ellipse(centre, {size, size * random.Uniform(0.4F, 1.0F)}, turn, ink);
  } else if (kind == 1) {
    canvas.Ring(centre, size, size * random.Uniform(0.1F, 0.5F), ink);
  } else {
    // A regular polygon, or a star when every second corner is pulled in.
    const int corners = random.Integer(3, 9);
    const float inner = kind == 2 ? 1.0F : random.Uniform(0.35F, 0.7F);
    std::vector<Point> outline;
    for (int i = 0; i < 2 * corners; ++i) {
      const float angle = turn + kPi * i / corners;
      const float radius =
          size * (i % 2 == 0 ? 1.0F : inner * (kind == 2 ? std::cos(kPi / corners) : 1.0F));
      outline.emplace_back(centre + radius * Point(std::cos(angle), std::sin(angle)));
    }
    canvas.Polygon(outline, ink);
  }
}

void PaintLettering(Canvas& canvas, Random& random, const Palette& palette) {
  const auto h = static_cast<float>(canvas.height());
  float y = h * random.Uniform(0.02F, 0.08F);
  while (y < h) {
    const float height = h * random.LogUniform(0.03F, 0.22F);
    y += height * 1.25F;
    if (random.Chance(0.2F))
      canvas.Rectangle({0.0F, y - 1.15F * height},
                       {static_cast<float>(canvas.width()), y + 0.15F * height},
                       palette.Any(random));
    const Ink& ink = random.Chance(0.5F) ? palette.dark : palette.Any(random);
    float x = -height * random.Uniform();
    while (x < static_cast<float>(canvas.width())) {
      x += canvas.Text(Word(random, 2, 10), {x, y}, height, height * random.Uniform(0.08F, 0.24F),
                       ink, random.Chance(0.3F) ? 0.2F : 0.0F) +
           0.6F * height;
    }
  }
}

void PaintLogo(Canvas& canvas, Random& random, const Palette& palette) {
  const auto h = static_cast<float>(canvas.height());
  const int count = random.Integer(8, 40);
  for (int i = 0; i < count; ++i) {
    DrawShape(canvas, random, AnyPoint(canvas, random), h * random.LogUniform(0.03F, 0.25F),
              random.Chance(0.2F) ? palette.dark : palette.Any(random));
  }
  const int words = random.Integer(2, 6);
  for (int i = 0; i < words; ++i) {
    const float height = h * random.LogUniform(0.05F, 0.25F);
    canvas.Text(Word(random, 3, 8), AnyPoint(canvas, random) * Point(0.6F, 1.0F), height,
                height * 0.2F, palette.dark);
  }
}

// Tartan: the same random stripes across and down, half transparent where they cross; marks on top
// so that the pattern does not repeat exactly.
void PaintChecks(Canvas& canvas, Random& random, const Palette& palette) {
  const auto w = static_cast<float>(canvas.width());
  const auto h = static_cast<float>(canvas.height());
  float at = 0.0F;
  while (at < std::max(w, h)) {
    const float stripe = w * random.LogUniform(0.006F, 0.12F);
    const Ink& ink = palette.Any(random);
    if (random.Chance(0.7F)) {
      canvas.Rectangle({at, 0.0F}, {at + stripe, h}, ink, 0.6F);
      canvas.Rectangle({0.0F, at}, {w, at + stripe}, ink, 0.5F);
    }
    at += stripe * random.Uniform(0.8F, 1.6F);
  }
  Mottle(canvas, random, 0.8F, 14.0F);
  const int marks = random.Integer(4, 20);
  for (int i = 0; i < marks; ++i)
    DrawShape(canvas, random, AnyPoint(canvas, random), w * random.Uniform(0.008F, 0.035F),
              palette.dark);
}

void PaintFloral(Canvas& canvas, Random& random, const Palette& palette) {
  const auto w = static_cast<float>(canvas.width());
  const int stems = random.Integer(6, 18);
  for (int i = 0; i < stems; ++i) {
    Point p = AnyPoint(canvas, random);
    float angle = random.Angle();
    const Ink green = FromHue(random.Uniform(0.22F, 0.45F), random.Uniform(0.3F, 0.8F),
                              random.Uniform(0.2F, 0.6F));
    for (int step = 0; step < 12; ++step) {
      angle += random.Uniform(-0.5F, 0.5F);
      const Point next = p + 0.03F * w * Point(std::cos(angle), std::sin(angle));
      canvas.Line(p, next, 0.006F * w, green);
      const float side = angle + (step % 2 == 0 ? 0.9F : -0.9F);
      canvas.Ellipse(next + 0.022F * w * Point(std::cos(side), std::sin(side)),
                     {0.025F * w, 0.01F * w}, side, green * random.Uniform(0.7F, 1.2F), 0.5F);
      p = next;
    }
  }
  const int flowers = random.Integer(15, 50);
  for (int i = 0; i < flowers; ++i) {
    const Point centre = AnyPoint(canvas, random);
    const float size = w * random.LogUniform(0.015F, 0.08F);
    const int petals = random.Integer(4, 11);
    const Ink& ink = palette.Any(random);
    const float turn = random.Angle();
    for (int ring = 0; ring < 2; ++ring) {
      for (int petal = 0; petal < petals; ++petal) {
        const float angle = turn + 2.0F * kPi * (petal + 0.5F * ring) / static_cast<float>(petals);
        const float reach = size * (ring == 0 ? 1.0F : 0.6F);
        canvas.Ellipse(centre + 0.6F * reach * Point(std::cos(angle), std::sin(angle)),
                       {0.55F * reach, 1.6F * reach / petals}, angle,
                       ink * (ring == 0 ? random.Uniform(0.75F, 1.0F) : 1.15F), -0.4F);
      }
    }
    canvas.Ellipse(centre, {0.25F * size, 0.25F * size}, 0.0F, palette.dark);
  }
}

// Warp and weft of changing colours, over and under by a small random draft, with knots.
void PaintWoven(Canvas& canvas, Random& random, const Palette& palette) {
  const int thread = random.Integer(3, 8);
  const int draft = random.Integer(3, 8);
  std::vector<Ink> warp, weft;
  Ink ink = palette.Any(random);
  for (int i = 0; i * thread < std::max(canvas.width(), canvas.height()); ++i) {
    if (random.Chance(0.15F)) ink = palette.Any(random);
    warp.push_back(ink * random.Uniform(0.85F, 1.1F));
    weft.push_back((random.Chance(0.7F) ? palette.paper : ink) * random.Uniform(0.85F, 1.1F));
  }
  const std::uint32_t pattern = random.Next() | random.Next();
  const Noise noise(random);
  const float figure = random.Uniform(4.0F, 10.0F) / static_cast<float>(canvas.width());
  for (int y = 0; y < canvas.height(); ++y) {
    for (int x = 0; x < canvas.width(); ++x) {
      const int column = x / thread;
      const int row = y / thread;
      const bool drafted =
          ((pattern >> static_cast<unsigned>((column % draft + 5 * (row % draft)) % 32)) & 1U) != 0;
      // A large figure decides which of the two comes to the front, as in a jacquard.
      const bool over = (noise.At(x * figure, y * figure, 3) > 0.5F) != drafted;
      const float across = static_cast<float>(over ? x % thread : y % thread) / thread - 0.4F;
      canvas.At(x, y) = (over ? warp[column] : weft[row]) * (1.05F - across * across);
    }
  }
}

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
  const float column = 0.94F * w / columns;
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
  const Ink& ray = palette.Any(random);
  for (int i = 0; i < rays; ++i) {
    const float a = 2.0F * kPi * i / rays;
    const float b = a + kPi / rays;
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
      const float height = noise.At(x * scale, y * scale, 6);
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
    const Point& other = towns[random.Integer(0, static_cast<int>(towns.size()) - 1)];
    const Ink& road = palette.Any(random);
    Point from = town;
    for (int step = 1; step <= 6; ++step) {
      const Point jitter(random.Normal(), random.Normal());
      const Point to = town + (other - town) * (step / 6.0F) +
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

std::string ToString(ProceduralKind kind) {
  constexpr std::array<std::string_view, kProceduralKinds> kNames = {
      "lettering", "logo", "checks", "floral", "woven", "newspaper", "packaging", "map"};
  return std::string(kNames[static_cast<std::size_t>(kind)]);
}

Image PaintProcedural(ProceduralKind kind, std::uint64_t seed, int side_px) {
  Random random(seed, 1000 + static_cast<std::uint64_t>(kind));
  const float aspect = random.LogUniform(0.65F, 1.5F);
  const auto [width, height] = FitSide(side_px, aspect);
  const Palette palette(random);
  Canvas canvas(std::max(16, width), std::max(16, height), palette.paper);
  using Painter = void (*)(Canvas&, Random&, const Palette&);
  constexpr std::array<Painter, kProceduralKinds> kPainters = {
      PaintLettering, PaintLogo,      PaintChecks,    PaintFloral,
      PaintWoven,     PaintNewspaper, PaintPackaging, PaintMap};
  kPainters[static_cast<std::size_t>(kind)](canvas, random, palette);
  Mottle(canvas, random, 0.12F, 40.0F);
  return canvas.ToImage();
}

TextureSource ProceduralTextures(int count, std::uint64_t seed, int side_px) {
  if (count < 1) {
    throw Error(ErrorCode::kInvalidArgument, "option_out_of_range",
                "the number of procedural textures must be at least 1");
  }
  TextureSource source;
  for (int i = 0; i < count; ++i) {
    const auto kind = static_cast<ProceduralKind>(i % kProceduralKinds);
    std::array<char, 16> number{};
    std::snprintf(number.data(), number.size(), "-%04d", i);
    source.Add("procedural/" + ToString(kind) + number.data(),
               PaintProcedural(kind, seed + static_cast<std::uint64_t>(i), side_px));
  }
  return source;
}

}  // namespace pliant::simulation
