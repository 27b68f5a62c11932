// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Common parts of the painters of procedural pictures. Internal.
#pragma once

#include <array>
#include <string>

#include "descriptor/simulation/canvas.h"
#include "descriptor/simulation/random.h"

namespace pliant::simulation {

// Each from 0 to 1; the hue repeats.
Ink FromHue(float hue, float saturation, float value);

// A few colours that go together: neighbours and opposites of one hue, light and dark.
class Palette {
 public:
  explicit Palette(Random& random);
  const Ink& Any(Random& random) const;

  Ink paper, dark;

 private:
  std::array<Ink, 6> inks_;
};

// Capital letters that can be pronounced, nearly.
std::string Word(Random& random, int shortest, int longest);

Point AnyPoint(const Canvas& canvas, Random& random);

// Makes the picture lighter and darker by `amount`, in spots of which `cells` fit its width.
void Mottle(Canvas& canvas, Random& random, float amount, float cells);

// Lines of text that fill a column; returns where the next line would start.
float Column(Canvas& canvas, Random& random, const Point& top_left, float column_width,
             float bottom, float height, const Ink& ink);

// An ellipse, ring, polygon or star.
void DrawShape(Canvas& canvas, Random& random, const Point& centre, float size, const Ink& ink);

}  // namespace pliant::simulation
