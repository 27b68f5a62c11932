// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "descriptor/simulation/procedural_painters.h"

namespace pliant::simulation {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

}  // namespace

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
    const Ink ink = random.Chance(0.5F) ? palette.dark : palette.Any(random);
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
    const Ink ink = palette.Any(random);
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
    const Ink ink = palette.Any(random);
    const float turn = random.Angle();
    for (int ring = 0; ring < 2; ++ring) {
      for (int petal = 0; petal < petals; ++petal) {
        const float angle =
            turn + 2.0F * kPi * (static_cast<float>(petal) + 0.5F * static_cast<float>(ring)) /
                       static_cast<float>(petals);
        const float reach = size * (ring == 0 ? 1.0F : 0.6F);
        canvas.Ellipse(centre + 0.6F * reach * Point(std::cos(angle), std::sin(angle)),
                       {0.55F * reach, 1.6F * reach / static_cast<float>(petals)}, angle,
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
      const bool over = (noise.At(static_cast<float>(x) * figure, static_cast<float>(y) * figure,
                                  3) > 0.5F) != drafted;
      const float across =
          static_cast<float>(over ? x % thread : y % thread) / static_cast<float>(thread) - 0.4F;
      canvas.At(x, y) =
          (over ? warp[static_cast<std::size_t>(column)] : weft[static_cast<std::size_t>(row)]) *
          (1.05F - across * across);
    }
  }
}

}  // namespace pliant::simulation
