// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Descriptors in few bytes. A row of floats is rotated and its components rounded to 4 bits.
//
// The rotation (random signs, then the Walsh-Hadamard transform) spreads what a row says over all
// of its components, so that one step size suits them all, whatever the descriptor (Ailon and
// Chazelle, "The fast Johnson-Lindenstrauss transform", SIAM J. Comput. 2009). index/FORMAT.md has
// the bytes. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "descriptor/features/features.h"
#include "descriptor/image/image.h"

namespace pliant {

// Not owned: rows x CodedRowBytes(kind, dim) bytes.
struct CodedDescriptors {
  DescriptorKind kind = DescriptorKind::kFloat;
  std::size_t rows = 0;
  int dim = 0;
  Bytes bytes;
};

// A row of floats: component i of the rotated row is scale x (level i - kMiddleLevel).
struct CodedRow {
  static constexpr float kMiddleLevel = 7.5F;

  float scale = 0;
  const std::uint8_t* levels = nullptr;  // 0..15, two a byte, the first in the low half
};

// Components of a coded row: dim, rounded up to a power of two, and at least two.
std::size_t CodedComponents(int dim);

// Bytes of one row: for floats a scale and half a byte for each component; for bits as they are.
std::size_t CodedRowBytes(DescriptorKind kind, int dim);

// Floats only. Throws kCorrupt "blob_corrupt" for a scale that no row can have.
CodedRow ReadCodedRow(const CodedDescriptors& coded, std::size_t row);

// The rotation of rows of n = 2^k components; orthonormal.
class CodingRotation {
 public:
  explicit CodingRotation(std::size_t n);
  void Forward(std::span<float> row) const;
  void Back(std::span<float> row) const;

 private:
  void Flip(std::span<float> row) const;
  std::vector<float> signs_;
};

// Appends all rows. Throws kInvalidArgument for values that are not finite or above 1e30.
void PutDescriptors(const Descriptors& descriptors, std::vector<std::uint8_t>* out);

// Throws kCorrupt as ReadCodedRow does.
Descriptors GetDescriptors(const CodedDescriptors& coded);

}  // namespace pliant
