// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/descriptor_codec.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <span>

#include "descriptor/base/error.h"
#include "index/store/compressed.h"

namespace pliant {
namespace {

constexpr float kStep = 0.55F;  // of a row's root mean square
constexpr int kZero = 128;      // the code of 0
constexpr int kMost = 127;      // steps
// Root mean square of a row of 2^14 components; their sums stay finite.
constexpr float kLargest = 0x1p108F;

std::size_t Components(int dim) {
  return std::bit_ceil(std::max<std::size_t>(1, static_cast<std::size_t>(dim)));
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

  static void Transform(std::span<float> row) {
    for (std::size_t half = 1; half < row.size(); half *= 2) {
      for (std::size_t first = 0; first < row.size(); first += 2 * half) {
        float* const a = row.data() + first;
        float* const b = a + half;
        for (std::size_t i = 0; i < half; ++i) {
          const float sum = a[i] + b[i];
          b[i] = a[i] - b[i];
          a[i] = sum;
        }
      }
    }
    const float norm = 1.0F / std::sqrt(static_cast<float>(row.size()));
    for (float& value : row) value *= norm;
  }

  std::vector<float> signs_;
};

void CheckRow(std::span<const float> rotated) {
  for (const float value : rotated) {
    if (std::abs(value) <= kLargest) continue;
    throw Error(ErrorCode::kInvalidArgument, "descriptor_not_finite",
                "a descriptor holds a value that is not a finite number, or too large");
  }
}

// Root mean square.
std::uint16_t PutRow(std::span<const float> rotated, std::uint8_t* codes) {
  double squares = 0;
  for (const float value : rotated) squares += static_cast<double>(value) * value;
  const std::uint16_t half =
      ToHalf(static_cast<float>(std::sqrt(squares / static_cast<double>(rotated.size()))));
  const float size = FromHalf(half);
  const float steps = size > 0 ? 1 / (kStep * size) : 0;
  for (std::size_t i = 0; i < rotated.size(); ++i) {
    const float most = kMost;
    const float level = std::clamp(std::nearbyint(rotated[i] * steps), -most, most);
    codes[i] = static_cast<std::uint8_t>(kZero + static_cast<int>(level));
  }
  return half;
}

// With the root mean square that the row had, so that it would get the same codes again.
void GetRow(std::uint16_t half, const std::uint8_t* codes, std::span<float> rotated) {
  const float size = FromHalf(half);
  if (!(size >= 0 && size <= kLargest)) {
    throw Error(ErrorCode::kCorrupt, "blob_corrupt",
                "stored features have a descriptor whose length is not a number");
  }
  float squares = 0;
  for (std::size_t i = 0; i < rotated.size(); ++i) {
    rotated[i] = static_cast<float>(int{codes[i]} - kZero);
    squares += rotated[i] * rotated[i];
  }
  const float scale =
      squares > 0 ? size * std::sqrt(static_cast<float>(rotated.size()) / squares) : 0;
  for (float& value : rotated) value *= scale;
}

// All roots, then all codes.
void PutFloats(const Descriptors& descriptors, std::vector<std::uint8_t>* out) {
  const auto dim = static_cast<std::size_t>(descriptors.dim);
  const std::size_t components = Components(descriptors.dim);
  const Rotation rotation(components);
  std::vector<float> row(components);
  std::vector<std::uint8_t> plain(descriptors.rows * (sizeof(std::uint16_t) + components));
  std::uint8_t* const codes = plain.data() + descriptors.rows * sizeof(std::uint16_t);
  for (std::size_t i = 0; i < descriptors.rows; ++i) {
    std::copy_n(descriptors.floats.data() + i * dim, dim, row.begin());
    std::fill(row.begin() + static_cast<std::ptrdiff_t>(dim), row.end(), 0.0F);
    rotation.Forward(row);
    CheckRow(row);
    const std::uint16_t half = PutRow(row, codes + i * components);
    std::memcpy(plain.data() + i * sizeof(half), &half, sizeof(half));
  }
  PutCompressed(plain, Compression::kValuesOnly, out);
}

Descriptors GetFloats(Bytes bytes, std::size_t* offset, std::size_t rows, int dim) {
  const auto kept = static_cast<std::size_t>(dim);
  const std::size_t components = Components(dim);
  const std::vector<std::uint8_t> plain =
      GetCompressed(bytes, offset, rows * (sizeof(std::uint16_t) + components));
  const std::uint8_t* const codes = plain.data() + rows * sizeof(std::uint16_t);
  Descriptors result = Descriptors::Float(rows, dim);
  const Rotation rotation(components);
  std::vector<float> row(components);
  for (std::size_t i = 0; i < rows; ++i) {
    std::uint16_t half = 0;
    std::memcpy(&half, plain.data() + i * sizeof(half), sizeof(half));
    GetRow(half, codes + i * components, row);
    rotation.Back(row);
    std::copy_n(row.begin(), kept, result.floats.data() + i * kept);
  }
  return result;
}

}  // namespace

void PutDescriptors(const Descriptors& descriptors, std::vector<std::uint8_t>* out) {
  if (descriptors.kind == DescriptorKind::kFloat) return PutFloats(descriptors, out);
  out->insert(out->end(), descriptors.bytes.begin(), descriptors.bytes.end());
}

Descriptors GetDescriptors(Bytes bytes, std::size_t* offset, DescriptorKind kind, std::size_t rows,
                           int dim) {
  if (kind == DescriptorKind::kFloat) return GetFloats(bytes, offset, rows, dim);
  if (rows * static_cast<std::size_t>(dim) > bytes.size() - *offset) {
    throw Error(ErrorCode::kCorrupt, "blob_corrupt",
                "stored features end within their descriptors");
  }
  Descriptors result = Descriptors::Binary(rows, dim);
  std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(*offset), result.bytes.size(),
              result.bytes.begin());
  *offset += result.bytes.size();
  return result;
}

}  // namespace pliant
