// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Flattens a bent object by its warp, and measures its similarity to the template.
#pragma once

#include <vector>

#include "descriptor/image/image.h"
#include "descriptor/warp/tps.h"

namespace pliant {

struct UnwarpedImage {
  Image image;              // width x height, as many channels as the frame; 0 where unseen
  std::vector<bool> known;  // per pixel: whether it lies within the frame
};

// Pixel p of the result shows the frame at frame_from_template(p), bilinearly. The spline is
// evaluated every 4 pixels and interpolated between. Throws kInvalidArgument for sizes below 1 or
// an empty frame.
UnwarpedImage Unwarp(const Image& frame, const ThinPlateSpline& frame_from_template, int width,
                     int height);

// Structural similarity (Wang et al. 2004) at each pixel of two grey images of one size: Gaussian
// window of 11 x 11, sigma 1.5, K1 = 0.01, K2 = 0.03; 1 = the same, around 0 = nothing in common.
// Throws kInvalidArgument for colour or sizes that differ.
std::vector<float> SsimMap(const Image& a, const Image& b);

}  // namespace pliant
