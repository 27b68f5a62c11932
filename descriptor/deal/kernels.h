// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The network's own hot loops, compiled for several instruction sets and chosen at run time.
// Everything is channels-last (row, column, channel). Internal to deal/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "descriptor/deal/weights.h"

namespace pliant::deal {

// A standardised patch in a frame: one wrapped row above and below, one zero column left and right.
inline constexpr int kFramedSide = kPatchSide + 2;
inline constexpr int kFramedPixels = kFramedSide * kFramedSide;

// Winograd's F(4x4, 3x3) (Lavin and Gray 2016): output tiles of 4 x 4 from input tiles of 6 x 6.
inline constexpr int kTileSide = 4;
inline constexpr int kTilePlanes = 36;

struct Kernels {
  const char* name;  // "avx512", "avx2", "baseline"

  // Bilinear samples of `image` (height x width, [0, 1]) at (x, y) + radius * (grid + shift),
  // clamped to the border. grid and shift: kPatchPixels x values, then as many y values; `shift`
  // may be null.
  void (*sample_patch)(const float* image, int height, int width, float x, float y, float radius,
                       const float* grid, const float* shift, float* patch);

  // Bilinear samples of `map` (height x width x channels) at the 5 x 5 points one cell apart around
  // cell (x, y), clamped to the border: 25 x channels values, rows slowest. Channels here and below
  // are multiples of 16.
  void (*sample_features)(const float* map, int height, int width, int channels, float x, float y,
                          float* out);
  void (*sample_features_bfloat16)(const float* map, int height, int width, int channels, float x,
                                   float y, std::uint16_t* out);

  // Zero mean, unit variance (eps 1e-5) over the patch, into a frame of kFramedPixels.
  void (*standardize)(const float* patch, float* framed);

  // 3 x 3 convolution 1 -> channels with bias and ReLU from a frame; weight 9 x channels, out
  // side x side x channels with side = 32 / stride; stride 1 or 2.
  void (*first_conv)(const float* framed, int channels, int stride, const float* weight,
                     const float* bias, float* out);
  void (*first_conv_bfloat16)(const float* framed, int channels, int stride, const float* weight,
                              const float* bias, std::uint16_t* out);

  // The tiles of a side x side x channels map, circular in rows and zero outside its columns, to
  // kTilePlanes planes of (side/4)^2 x channels values; plane p starts at tiles + p * plane.
  void (*winograd_input)(const float* in, int side, int channels, std::size_t plane, float* tiles);

  // Planes back to a side x side x channels map, plus bias and ReLU.
  void (*winograd_output)(const float* tiles, int side, int channels, std::size_t plane,
                          const float* bias, float* out);

  // As winograd_output, then the mean over rows (the angle): side x channels values.
  void (*winograd_pooled)(const float* tiles, int side, int channels, std::size_t plane,
                          const float* bias, float* out);
};

// The kernel sets that this processor supports, best first.
const std::vector<const Kernels*>& UsableKernels();

inline const Kernels& BestKernels() { return *UsableKernels().front(); }

}  // namespace pliant::deal
