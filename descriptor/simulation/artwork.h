// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Drawings as they are printed on cloth: a few inks on a ground that is not printed.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "descriptor/image/image.h"
#include "descriptor/simulation/canvas.h"
#include "descriptor/simulation/random.h"
#include "descriptor/simulation/texture.h"

namespace pliant::simulation {

struct Artwork {
  int width = 0;
  int height = 0;
  // height x width: sRGB values 0..1 times the cover, then the cover (0 = bare ground).
  std::vector<Eigen::Array4f> inks;
  Ink ground = Ink::Ones();  // the ground that the drawing was made for

  float aspect() const { return static_cast<float>(height) / width; }
};

// A painted drawing (figures with outlines, a badge, letters) or, from `image` (may be null), a
// screen print of it: few flat colours, thin lines, halftone, cut to a shape.
Artwork DrawArtwork(Random& random, const Texture* image);

// A plausible colour of cloth: white, black, grey or dyed.
Ink DrawClothColour(Random& random);

// Contrast of the drawing on cloth of this colour: mean difference over the ink.
float Contrast(const Artwork& artwork, const Ink& cloth);

// How much brighter the inks are than a cloth of this colour, mean; negative: darker.
float Brighter(const Artwork& artwork, const Ink& cloth);

// Where on a chart the drawing goes, in u and v.
struct PrintPlace {
  Eigen::Array2f low = Eigen::Array2f(0.3F, 0.3F);
  Eigen::Array2f high = Eigen::Array2f(0.7F, 0.7F);
};

struct PrintOptions {
  Ink cloth = Ink::Ones();
  float opacity = 1.0F;  // of the ink
  float fading = 0.0F;   // worn spots, 0..1
};

// The drawing on a cloth of width x height pixels that covers the whole chart.
Image PrintOn(const Artwork& artwork, const PrintPlace& place, const PrintOptions& options,
              int width, int height, Random& random);

}  // namespace pliant::simulation
