// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/descriptor_codec.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <span>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

constexpr std::size_t kScaleBytes = 2;
constexpr float kLargestLevel = 7.5F;  // levels: -7.5, -6.5, ..., 7.5
// Of a row of 2^14 components; their sum of 8 scales each stays finite.
constexpr float kLargestScale = 0x1p108F;

// At least two: a byte has two.
std::size_t Components(int dim) {
  return std::bit_ceil(std::max<std::size_t>(2, static_cast<std::size_t>(dim)));
}

// bfloat16: the upper half of a float.
std::uint16_t ToHalf(float value) {
  return static_cast<std::uint16_t>((std::bit_cast<std::uint32_t>(value) + 0x8000U) >> 16U);
}
float FromHalf(std::uint16_t half) { return std::bit_cast<float>(std::uint32_t{half} << 16U); }

// Of a row of n = 2^k components; orthonormal.
class Rotation {
 public:
  explicit Rotation(std::size_t n) : signs_(n) {
    std::uint32_t state = 1;
    for (float& sign : signs_) {
      state = state * 1664525U + 1013904223U;
      sign = (state >> 31U) != 0 ? -1.0F : 1.0F;
    }
  }

  void Forward(std::span<float> row) const {
    Flip(row);
    Transform(row);
  }
  void Back(std::span<float> row) const {
    Transform(row);  // its own inverse
    Flip(row);
  }

 private:
  void Flip(std::span<float> row) const {
    for (std::size_t i = 0; i < row.size(); ++i) row[i] *= signs_[i];
  }

  // For the smallest sizes the compiler must know them, or it takes one value at a time.
  template <std::size_t kHalf = 0>
  static void AddAndSubtract(std::span<float> row, std::size_t half = kHalf) {
    if constexpr (kHalf != 0) half = kHalf;
    for (std::size_t first = 0; first + 2 * half <= row.size(); first += 2 * half) {
      float* const a = row.data() + first;
      float* const b = a + half;
      for (std::size_t i = 0; i < half; ++i) {
        const float sum = a[i] + b[i];
        b[i] = a[i] - b[i];
        a[i] = sum;
      }
    }
  }

  static void Transform(std::span<float> row) {
    AddAndSubtract<1>(row);
    AddAndSubtract<2>(row);
    AddAndSubtract<4>(row);
    for (std::size_t half = 8; half < row.size(); half *= 2) AddAndSubtract(row, half);
    const float norm = 1.0F / std::sqrt(static_cast<float>(row.size()));
    for (float& value : row) value *= norm;
  }

  std::vector<float> signs_;
};

void PutRow(std::span<const float> rotated, std::vector<std::uint8_t>* out) {
  float largest = 0;
  for (const float value : rotated) largest = std::max(largest, std::abs(value));
  const std::uint16_t half = ToHalf(std::min(largest / kLargestLevel, kLargestScale));
  const float scale = FromHalf(half);
  out->push_back(static_cast<std::uint8_t>(half));
  out->push_back(static_cast<std::uint8_t>(half >> 8U));
  const float steps = scale > 0 ? 1.0F / scale : 0.0F;
  const auto level = [&](float value) {
    return static_cast<unsigned>(std::clamp(std::floor(value * steps) + 8.0F, 0.0F, 15.0F));
  };
  for (std::size_t i = 0; i < rotated.size(); i += 2) {
    out->push_back(static_cast<std::uint8_t>(level(rotated[i]) | level(rotated[i + 1]) << 4U));
  }
}

void CheckRow(std::span<const float> rotated) {
  for (const float value : rotated) {
    if (std::abs(value) <= 8 * kLargestScale) continue;
    throw Error(ErrorCode::kInvalidArgument, "descriptor_not_finite",
                "a descriptor holds a value that is not a finite number, or too large");
  }
}

void PutFloats(const Descriptors& descriptors, std::vector<std::uint8_t>* out) {
  const auto dim = static_cast<std::size_t>(descriptors.dim);
  const Rotation rotation(Components(descriptors.dim));
  std::vector<float> row(Components(descriptors.dim));
  for (std::size_t i = 0; i < descriptors.rows; ++i) {
    std::copy_n(descriptors.floats.data() + i * dim, dim, row.begin());
    std::fill(row.begin() + static_cast<std::ptrdiff_t>(dim), row.end(), 0.0F);
    rotation.Forward(row);
    CheckRow(row);
    PutRow(row, out);
  }
}

Descriptors GetFloats(Bytes bytes, std::size_t rows, int dim) {
  Descriptors result = Descriptors::Float(rows, dim);
  const auto kept = static_cast<std::size_t>(dim);
  const Rotation rotation(Components(dim));
  std::vector<float> row(Components(dim));
  const std::size_t row_bytes = CodedRowBytes(DescriptorKind::kFloat, dim);
  for (std::size_t i = 0; i < rows; ++i) {
    const std::uint8_t* code = bytes.data() + i * row_bytes;
    const float scale = FromHalf(static_cast<std::uint16_t>(code[0] | code[1] << 8U));
    if (!(scale >= 0 && scale <= kLargestScale)) {
      throw Error(ErrorCode::kCorrupt, "blob_corrupt",
                  "stored features have a descriptor whose scale is not a number");
    }
    code += kScaleBytes;
    for (std::size_t j = 0; j < row.size() / 2; ++j) {
      row[2 * j] = scale * (static_cast<float>(code[j] & 15) - kLargestLevel);
      row[2 * j + 1] = scale * (static_cast<float>(code[j] >> 4) - kLargestLevel);
    }
    rotation.Back(row);
    std::copy_n(row.begin(), kept, result.floats.data() + i * kept);
  }
  return result;
}

}  // namespace

std::size_t CodedRowBytes(DescriptorKind kind, int dim) {
  if (kind == DescriptorKind::kBinary) return static_cast<std::size_t>(dim);
  return kScaleBytes + Components(dim) / 2;
}

void PutDescriptors(const Descriptors& descriptors, std::vector<std::uint8_t>* out) {
  if (descriptors.kind == DescriptorKind::kFloat) return PutFloats(descriptors, out);
  out->insert(out->end(), descriptors.bytes.begin(), descriptors.bytes.end());
}

Descriptors GetDescriptors(Bytes bytes, DescriptorKind kind, std::size_t rows, int dim) {
  if (kind == DescriptorKind::kFloat) return GetFloats(bytes, rows, dim);
  Descriptors result = Descriptors::Binary(rows, dim);
  std::copy_n(bytes.begin(), result.bytes.size(), result.bytes.begin());
  return result;
}

}  // namespace pliant
