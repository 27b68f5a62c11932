// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What cameras and programs do to an image after it is taken: fewer pixels, tone curves, noise
// reduction, sharpening, storing as JPEG again, enlarging.
#pragma once

#include "descriptor/image/image.h"
#include "descriptor/simulation/photo.h"
#include "descriptor/simulation/random.h"
#include "descriptor/simulation/renderer.h"

namespace pliant::simulation {

struct DevelopOptions {
  float enlarge = 1.0F;   // the photograph has so many times fewer pixels a side, then is enlarged
  bool cubic = true;      // how it is enlarged; else bilinear
  float contrast = 0.0F;  // of an S-shaped tone curve; negative flattens
  float smear = 0.0F;     // noise reduction: what differs little from its surroundings is smoothed
  float sharpen = 0.0F;   // amount of an unsharp mask
  float sharpen_px = 1.0F;  // its radius
  int jpeg_quality = 0;     // stored once more, with the blocks elsewhere; 0 = not
  int jpeg_shift = 0;       // by so many pixels
};

DevelopOptions DrawDevelop(Random& random, float strength);

// Takes the photograph of the frame and develops it; of the frame's own size, so that its truth
// holds. The frame's colours are used up.
Image Develop(Frame& frame, const PhotoOptions& photo, const DevelopOptions& options, int channels,
              Random& random);

// Mean over the area that each pixel of the smaller frame covers; without truth.
Frame Shrink(const Frame& frame, int width, int height);
Image Enlarge(const Image& image, int width, int height, bool cubic);
void Sharpen(Image& image, float amount, float sigma_px);

}  // namespace pliant::simulation
