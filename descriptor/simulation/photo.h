// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// From linear light to the image that a camera would store: lens, exposure, tone, noise, JPEG.
#pragma once

#include <vector>

#include "descriptor/image/image.h"
#include "descriptor/simulation/random.h"
#include "descriptor/simulation/renderer.h"

namespace pliant::simulation {

struct PhotoOptions {
  float exposure = 1.0F;
  Colour white_balance = Colour::Ones();
  float gamma = 1.0F;       // on top of sRGB's
  float vignette = 0.0F;    // loss of light in the corners, 0..1
  float defocus_px = 0.0F;  // standard deviation of the lens' blur
  float motion_px = 0.0F;   // length of the camera's motion
  float motion_angle = 0.0F;
  float black = 0.0F;       // haze: the darkest value that is stored, 0..1
  float read_noise = 0.0F;  // standard deviation, of 255
  float shot_noise = 0.0F;  // the same at full brightness; grows with the square root of the light
  int jpeg_quality = 0;     // 0 = no artefacts
};

// The exposure that maps the mean light on the object to middle grey, like a camera's light meter.
float MeterExposure(const Frame& frame);
// The same for all of the image, whatever it shows.
float MeterImage(const Frame& frame);

// strength 0 (studio) .. 1 (everything goes wrong); `exposure` is then relative to the meter's.
PhotoOptions DrawPhoto(Random& random, float strength);

// `channels` 1 or 3. The frame's colours are used up (blurred in place).
Image TakePhoto(Frame& frame, const PhotoOptions& options, int channels, Random& random);

// Gaussian blur by recursion-free separable convolution; width x height, in place.
void Blur(std::vector<Colour>& pixels, int width, int height, float sigma_px);

// Applies the losses of baseline JPEG at this quality (1..100) to the pixels: 8 x 8 cosine
// transform, the example tables of the standard, rounding.
void AddJpegArtefacts(Image& image, int quality);

}  // namespace pliant::simulation
