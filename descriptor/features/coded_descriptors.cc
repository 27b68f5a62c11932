// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/coded_descriptors.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

constexpr std::size_t kScaleBytes = 2;
// Of a row of 2^14 components; their sum of 8 scales each stays finite.
constexpr float kLargestScale = 0x1p108F;

// bfloat16: the upper half of a float.
std::uint16_t ToHalf(float value) {
  return static_cast<std::uint16_t>((std::bit_cast<std::uint32_t>(value) + 0x8000U) >> 16U);
}
float FromHalf(std::uint16_t half) { return std::bit_cast<float>(std::uint32_t{half} << 16U); }

// For the smallest sizes the compiler must know them, or it takes one value at a time.
template <std::size_t kHalf = 0>
void AddAndSubtract(std::span<float> row, std::size_t half = kHalf) {
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

// Walsh-Hadamard; its own inverse.
void Transform(std::span<float> row) {
  AddAndSubtract<1>(row);
  AddAndSubtract<2>(row);
  AddAndSubtract<4>(row);
  for (std::size_t half = 8; half < row.size(); half *= 2) AddAndSubtract(row, half);
  const float norm = 1.0F / std::sqrt(static_cast<float>(row.size()));
  for (float& value : row) value *= norm;
}

void PutRow(std::span<const float> rotated, std::vector<std::uint8_t>* out) {
  float largest = 0;
  for (const float value : rotated) largest = std::max(largest, std::abs(value));
  const std::uint16_t half = ToHalf(std::min(largest / CodedRow::kMiddleLevel, kLargestScale));
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
  const CodingRotation rotation(CodedComponents(descriptors.dim));
  std::vector<float> row(CodedComponents(descriptors.dim));
  for (std::size_t i = 0; i < descriptors.rows; ++i) {
    std::copy_n(descriptors.floats.data() + i * dim, dim, row.begin());
    std::fill(row.begin() + static_cast<std::ptrdiff_t>(dim), row.end(), 0.0F);
    rotation.Forward(row);
    CheckRow(row);
    PutRow(row, out);
  }
}

Descriptors GetFloats(const CodedDescriptors& coded) {
  Descriptors result = Descriptors::Float(coded.rows, coded.dim);
  const auto kept = static_cast<std::size_t>(coded.dim);
  const CodingRotation rotation(CodedComponents(coded.dim));
  std::vector<float> row(CodedComponents(coded.dim));
  for (std::size_t i = 0; i < coded.rows; ++i) {
    const auto [scale, levels] = ReadCodedRow(coded, i);
    for (std::size_t j = 0; j < row.size() / 2; ++j) {
      row[2 * j] = scale * (static_cast<float>(levels[j] & 15) - CodedRow::kMiddleLevel);
      row[2 * j + 1] = scale * (static_cast<float>(levels[j] >> 4) - CodedRow::kMiddleLevel);
    }
    rotation.Back(row);
    std::copy_n(row.begin(), kept, result.floats.data() + i * kept);
  }
  return result;
}

}  // namespace

CodingRotation::CodingRotation(std::size_t n) : signs_(n) {
  std::uint32_t state = 1;
  for (float& sign : signs_) {
    state = state * 1664525U + 1013904223U;
    sign = (state >> 31U) != 0 ? -1.0F : 1.0F;
  }
}

void CodingRotation::Forward(std::span<float> row) const {
  Flip(row);
  Transform(row);
}

void CodingRotation::Back(std::span<float> row) const {
  Transform(row);
  Flip(row);
}

void CodingRotation::Flip(std::span<float> row) const {
  for (std::size_t i = 0; i < row.size(); ++i) row[i] *= signs_[i];
}

std::size_t CodedComponents(int dim) {
  return std::bit_ceil(std::max<std::size_t>(2, static_cast<std::size_t>(dim)));
}

std::size_t CodedRowBytes(DescriptorKind kind, int dim) {
  if (kind == DescriptorKind::kBinary) return static_cast<std::size_t>(dim);
  return kScaleBytes + CodedComponents(dim) / 2;
}

CodedRow ReadCodedRow(const CodedDescriptors& coded, std::size_t row) {
  const std::uint8_t* bytes = coded.bytes.data() + row * CodedRowBytes(coded.kind, coded.dim);
  const float scale = FromHalf(static_cast<std::uint16_t>(bytes[0] | bytes[1] << 8U));
  if (!(scale >= 0 && scale <= kLargestScale)) {
    throw Error(ErrorCode::kCorrupt, "blob_corrupt",
                "stored features have a descriptor whose scale is not a number");
  }
  return {scale, bytes + kScaleBytes};
}

void PutDescriptors(const Descriptors& descriptors, std::vector<std::uint8_t>* out) {
  if (descriptors.kind == DescriptorKind::kFloat) return PutFloats(descriptors, out);
  out->insert(out->end(), descriptors.bytes.begin(), descriptors.bytes.end());
}

Descriptors GetDescriptors(const CodedDescriptors& coded) {
  if (coded.kind == DescriptorKind::kFloat) return GetFloats(coded);
  Descriptors result = Descriptors::Binary(coded.rows, coded.dim);
  std::copy_n(coded.bytes.begin(), result.bytes.size(), result.bytes.begin());
  return result;
}

}  // namespace pliant
