// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/procedural_parts.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>
#include <utility>
#include <vector>

namespace pliant::simulation {

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

const Ink& Palette::Any(Random& random) const {
  return inks_[static_cast<std::size_t>(random.Integer(0, 5))];
}

std::string Word(Random& random, int shortest, int longest) {
  constexpr std::string_view kConsonants = "BCDFGHJKLMNPRSTVWZ";
  constexpr std::string_view kVowels = "AEIOUY";
  std::string word;
  const int length = random.Integer(shortest, longest);
  bool vowel = random.Chance(0.4F);
  for (int i = 0; i < length; ++i) {
    const std::string_view from = vowel ? kVowels : kConsonants;
    word += from[static_cast<std::size_t>(random.Integer(0, static_cast<int>(from.size()) - 1))];
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
      canvas.At(x, y) *=
          1.0F +
          amount *
              (noise.At(static_cast<float>(x) * scale, static_cast<float>(y) * scale, 4) - 0.5F);
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
  constexpr float kPi = std::numbers::pi_v<float>;
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
      const float angle = turn + kPi * static_cast<float>(i) / static_cast<float>(corners);
      const float radius =
          size * (i % 2 == 0
                      ? 1.0F
                      : inner * (kind == 2 ? std::cos(kPi / static_cast<float>(corners)) : 1.0F));
      outline.emplace_back(centre + radius * Point(std::cos(angle), std::sin(angle)));
    }
    canvas.Polygon(outline, ink);
  }
}

}  // namespace pliant::simulation
