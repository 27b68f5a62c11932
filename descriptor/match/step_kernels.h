// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Inner loops of descriptor/match/stepped.h, one set per instruction set. Internal.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace pliant::kernels {

// Steps come in groups of this many, each row filled up with zeros to whole groups.
inline constexpr std::size_t kStepGroup = 4;

// Rows of whole steps -127..127 and what multiplies them, one of each a row.
struct StepRows {
  const std::int8_t* steps;  // rows x groups x kStepGroup
  const float* scales;
  const std::int32_t* sums;  // of the steps
  const float* norms;        // squared lengths
};

// The same, transposed: a panel's groups lie one after another, kPanel rows of a group together.
struct StepPanel {
  const std::int8_t* steps;  // groups x kPanel x kStepGroup
  const float* scales;
  const float* norms;
};

struct StepKernelSet {
  const char* name;
  // Splits a row of `dim` floats into steps and their scale (largest magnitude / 127). Returns
  // false when the steps do not give the row back to a millionth of its largest magnitude, or when
  // that is too near the limits of a float.
  bool (*split)(const float* row, std::size_t dim, std::int8_t* steps, float* scale);
  // out[r * kPanel + j] = |a_r - b_j|^2, never below zero.
  void (*squared_tile)(const StepRows& a, std::size_t rows, std::size_t groups,
                       const StepPanel& panel, float* out);
};

// The sets that this processor runs, the fastest last; none where floats are compared faster:
// without AVX2, and with AVX-512 but no VNNI.
const std::vector<StepKernelSet>& StepKernels();

}  // namespace pliant::kernels
