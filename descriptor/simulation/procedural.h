// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images generated from a seed, so that the simulator needs no files: lettering, logos,
// checks, flowers, weaves, newspaper pages, packaging and maps.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "descriptor/image/image.h"
#include "descriptor/simulation/canvas.h"
#include "descriptor/simulation/random.h"
#include "descriptor/simulation/texture.h"

namespace pliant::simulation {

// Common parts of the painters of procedural images. Internal.

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

// Makes the image lighter and darker by `amount`, in spots of which `cells` fit its width.
void Mottle(Canvas& canvas, Random& random, float amount, float cells);

// Lines of text that fill a column; returns where the next line would start.
float Column(Canvas& canvas, Random& random, const Point& top_left, float column_width,
             float bottom, float height, const Ink& ink);

// An ellipse, ring, polygon or star.
void DrawShape(Canvas& canvas, Random& random, const Point& centre, float size, const Ink& ink);

// One painter per kind of procedural image; the canvas is filled with the palette's paper colour.
// Internal.

// Patterns.
void PaintLettering(Canvas& canvas, Random& random, const Palette& palette);
void PaintLogo(Canvas& canvas, Random& random, const Palette& palette);
void PaintChecks(Canvas& canvas, Random& random, const Palette& palette);
void PaintFloral(Canvas& canvas, Random& random, const Palette& palette);
void PaintWoven(Canvas& canvas, Random& random, const Palette& palette);

// Printed matter.
void PaintNewspaper(Canvas& canvas, Random& random, const Palette& palette);
void PaintPackaging(Canvas& canvas, Random& random, const Palette& palette);
void PaintMap(Canvas& canvas, Random& random, const Palette& palette);

enum class ProceduralKind {
  kLettering,
  kLogo,
  kChecks,
  kFloral,
  kWoven,
  kNewspaper,
  kPackaging,
  kMap
};
inline constexpr int kProceduralKinds = 8;
std::string ToString(ProceduralKind kind);

// A colour image whose longer side is `side_px`.
Image PaintProcedural(ProceduralKind kind, std::uint64_t seed, int side_px = 640);

// `count` images, the kinds in turn, named "procedural/KIND-NNNN". Throws Error kInvalidArgument
// "option_out_of_range" when count < 1.
TextureSource ProceduralTextures(int count, std::uint64_t seed, int side_px = 640);

}  // namespace pliant::simulation
