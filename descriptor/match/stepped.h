// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Nearest neighbours of descriptors in the precision of the database: rows of 8-bit steps with a
// scale each. Their products are sums of whole numbers: with AVX-512 VNNI 2.5 times as fast as
// those of floats with AVX-512, with AVX2 1.8 times as fast as those of floats with AVX2.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "descriptor/features/features.h"
#include "descriptor/match/distance.h"

namespace pliant {

// Inner loops of descriptor/match/stepped.h, one set per instruction set. Internal.
namespace kernels {

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

}  // namespace kernels

// Rows laid out for the kernels, for either side of a comparison. Immutable and thread-safe. Keeps
// a copy; the source may be destroyed.
//
// As with PackedDescriptors a distance depends on its two rows only: identical rows are exactly 0
// apart, d(a, b) == d(b, a) bit for bit. It agrees with PackedDescriptors::FindNearest to the
// rounding of a float.
class SteppedDescriptors {
 public:
  // Nothing unless every row is a scale times whole numbers -127..127 of which the largest is 127,
  // as features read from the database are (index/store/blob_codec.h); nor for bits, for more
  // than 1024 components, or on a processor that is faster with floats.
  static std::optional<SteppedDescriptors> Of(const Descriptors& descriptors);

  int dim() const { return dim_; }
  std::size_t rows() const { return rows_; }

  // As PackedDescriptors::FindNearest, with what that throws.
  void FindNearest(const SteppedDescriptors& queries, std::size_t first, std::size_t count,
                   NearestTwo* nearest, NearestOne* nearest_query = nullptr) const;

 private:
  SteppedDescriptors() = default;
  bool Split(const Descriptors& descriptors);
  void Transpose();

  int dim_ = 0;
  std::size_t rows_ = 0;
  std::size_t groups_ = 0;           // of kStepGroup steps a row
  std::vector<std::int8_t> steps_;   // rows x groups_ x kStepGroup
  std::vector<std::int8_t> panels_;  // panels x groups_ x kPanel x kStepGroup
  std::vector<float> scales_;        // rows, padded to whole panels with 0
  std::vector<float> norms_;         // squared; padded with infinity
  std::vector<std::int32_t> sums_;   // of the steps
};

}  // namespace pliant
