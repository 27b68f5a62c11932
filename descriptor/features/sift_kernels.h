// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The hot loops of keypoint detection, compiled for several instruction sets and chosen at run
// time. Internal to features/.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "descriptor/features/sift.h"

namespace pliant::sift {

inline constexpr int kLevels = kLayers + 3;  // blurred images of an octave
inline constexpr int kLanes = 16;            // widths are rounded up to this: rows have room for it

// One row of each level of an octave, with the rows above and below it.
using LevelRows = std::array<std::array<const float*, 3>, kLevels>;

struct Kernels {
  const char* name;  // "avx512", "avx2", "baseline"

  // upper[x] = taps[0] rows[radius][x] + sum over j of taps[j] (rows[radius - j][x] +
  // rows[radius + j][x]) for x from left to right - 1; lower[x] the same one row further down.
  void (*blur_columns)(const float* const* rows, const float* taps, int radius, int left, int right,
                       float* upper, float* lower);

  // The same along a row, which has `radius` further values on both sides.
  void (*blur_row)(const float* row, const float* taps, int radius, int width, float* out);

  // Bit i of found[x]: the difference of levels i + 2 and i + 1 is beyond `threshold`, and an
  // extremum among its 26 neighbours. Columns 0 and width - 1 are undefined. scratch: 3 kLayers
  // rows of `stride` values.
  void (*find_extrema)(const LevelRows& rows, float threshold, int width, int stride,
                       float* scratch, std::int32_t* found);
};

// The kernel sets that this processor supports, best first.
const std::vector<const Kernels*>& UsableKernels();

inline const Kernels& BestKernels() { return *UsableKernels().front(); }

}  // namespace pliant::sift
