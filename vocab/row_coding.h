// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The code of one descriptor (residual_codes.h) from its stored levels (coded_descriptors.h), in
// integers: every processor computes the same codes. Private to vocab/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace pliant {

constexpr std::size_t kCentroids = 16;  // of a part
constexpr std::size_t kLanesAtOnce = 16;
// As many products of levels and factors as 16 bits can sum: 8 x 2 x 15 x 127 < 2^15.
constexpr std::size_t kPairsAtOnce = 8;

// Outputs are the components of the rotated residual: component d of part p is output
// (d / 2 x lanes + p) x 2 + d % 2. What is rounded up is zeros.
struct RowTables {
  std::size_t lanes = 0;                // parts, rounded up to kLanesAtOnce
  std::size_t outputs = 0;              // lanes x components of a part, rounded up to 2
  std::size_t bytes = 0;                // of levels
  std::size_t pairs = 0;                // bytes, rounded up to kPairsAtOnce
  std::vector<std::int8_t> rotation;    // by pair of levels, then output: the pair's two factors
  std::vector<std::int32_t> middles;    // of each output for middle levels, twice
  std::vector<std::int16_t> centroids;  // by centroid, then output: multiples of 16
  std::vector<std::int32_t> norms;      // by centroid, then lane: |c|^2 / 2, times 16, plus c
};

struct RowScratch {
  explicit RowScratch(const RowTables& tables)
      : levels(tables.pairs), residual(tables.outputs), nearest(tables.lanes) {}

  std::vector<std::uint32_t> levels;
  std::vector<std::int16_t> residual;
  std::vector<std::int32_t> nearest;  // the result: the centroid of each part
};

// Twice a rotated output times `factor` is in the units of `word`, the rotated word. Returns
// 16 (|c|^2 / 2 + c . word), c the chosen centroids, in units of a centroid times those of a word.
std::int32_t CodeRow(const RowTables& tables, const std::uint8_t* levels, float factor,
                     const std::int16_t* word, RowScratch* scratch);
// The same without instructions that only some processors have.
std::int32_t CodeRowAnywhere(const RowTables& tables, const std::uint8_t* levels, float factor,
                             const std::int16_t* word, RowScratch* scratch);

// `value` rounded to a whole number that a residual can be; no number counts as the largest.
std::int16_t ToFixed(float value);

}  // namespace pliant
