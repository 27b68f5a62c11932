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

// The exposure that maps the mean light to middle grey, like a camera's light meter: of the object
// with a weight of `object_share`, of the whole image with the rest.
float MeterExposure(const Frame& frame, float object_share);

// strength 0 (studio) .. 1 (everything goes wrong); `exposure` is then relative to the meter's.
PhotoOptions DrawPhoto(Random& random, float strength);

// `channels` 1 or 3. The frame's colours are used up (blurred in place).
Image TakePhoto(Frame& frame, const PhotoOptions& options, int channels, Random& random);

// Gaussian blur by recursion-free separable convolution; width x height, in place.
void Blur(std::vector<Colour>& pixels, int width, int height, float sigma_px);

// Applies the losses of baseline JPEG at this quality (1..100) to the pixels: 8 x 8 cosine
// transform, the example tables of the standard, rounding.
void AddJpegArtefacts(Image& image, int quality);

// What cameras and programs do to an image after it is taken: fewer pixels, tone curves, noise
// reduction, sharpening, storing as JPEG again, enlarging.
struct DevelopOptions {
  float enlarge = 1.0F;   // factor by which the photograph is made smaller per side, then enlarged
  bool cubic = true;      // how it is enlarged; else bilinear
  float contrast = 0.0F;  // of an S-shaped tone curve; negative flattens
  float smear = 0.0F;     // noise reduction: what differs little from its surroundings is smoothed
  float sharpen = 0.0F;   // amount of an unsharp mask
  float sharpen_px = 1.0F;  // its radius
  int jpeg_quality = 0;     // stored once more, with the blocks elsewhere; 0 = not
  int jpeg_shift = 0;       // shift of the blocks, in pixels
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
