// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Nearest neighbours of descriptors in the precision of the database: rows of 8-bit steps, each row
// with a scale. Their products are sums of whole numbers. With AVX-512 VNNI these are 2.5 times as
// fast as products of floats with AVX-512; with AVX2 they are 1.8 times as fast as floats with
// AVX2.
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

// Number of steps in a group. Each row is padded with zeros to whole groups.
inline constexpr std::size_t kStepGroup = 4;

// Rows of whole steps -127..127; every other array has one value per row.
struct StepRows {
  const std::int8_t* steps;  // rows x groups x kStepGroup
  const float* scales;
  const std::int32_t* sums;  // of the steps
  const float* norms;        // squared lengths
};

// The same, transposed: the groups of a panel follow one another, each with kPanel rows.
struct StepPanel {
  const std::int8_t* steps;  // groups x kPanel x kStepGroup
  const float* scales;
  const float* norms;
};

struct StepKernelSet {
  const char* name;
  // Splits a row of `dim` floats into steps and their scale (largest magnitude / 127). Returns
  // false if the steps do not restore the row to a millionth of its largest magnitude, or if that
  // magnitude is too near the limits of a float.
  bool (*split)(const float* row, std::size_t dim, std::int8_t* steps, float* scale);
  // out[r * kPanel + j] = |a_r - b_j|^2, never below zero.
  void (*squared_tile)(const StepRows& a, std::size_t rows, std::size_t groups,
                       const StepPanel& panel, float* out);
};

// The sets that this processor supports, the fastest last. None if floats are faster: without AVX2,
// and with AVX-512 but without VNNI.
const std::vector<StepKernelSet>& StepKernels();

}  // namespace kernels

// Rows laid out for the kernels, for either side of a comparison. Immutable and thread-safe. Keeps
// a copy; the source may be destroyed.
//
// As with PackedDescriptors, a distance depends on its two rows only. The distance of identical
// rows is exactly 0, and d(a, b) == d(b, a) bit for bit. It equals that of
// PackedDescriptors::FindNearest to the rounding of a float.
class SteppedDescriptors {
 public:
  // nullopt unless every row is a scale times whole numbers -127..127 with largest magnitude 127,
  // like features from the database (index/store/blob_codec.h). Also nullopt for bits, for more
  // than 1024 components, and on processors that are faster with floats.
  static std::optional<SteppedDescriptors> Of(const Descriptors& descriptors);

  int dim() const { return dim_; }
  std::size_t rows() const { return rows_; }

  // As PackedDescriptors::FindNearest, which throws the same.
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
