// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Seeded random descriptors for tests.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "descriptor/features/coded_descriptors.h"

namespace pliant::testing {

inline Descriptors RandomFloats(std::size_t rows, int dim, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<float> normal;
  auto out = Descriptors::Float(rows, dim);
  for (float& x : out.floats) x = normal(generator);
  return out;
}

// Small whole numbers: every sum of squares is exact, and ties abound.
inline Descriptors RandomGrid(std::size_t rows, int dim, int levels, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  auto out = Descriptors::Float(rows, dim);
  for (float& x : out.floats) x = static_cast<float>(generator() % static_cast<unsigned>(levels));
  return out;
}

inline Descriptors RandomBits(std::size_t rows, int bytes, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  auto out = Descriptors::Binary(rows, bytes);
  for (auto& x : out.bytes) x = static_cast<std::uint8_t>(generator());
  return out;
}

// `descriptors` as they are stored.
class Coded {
 public:
  explicit Coded(const Descriptors& descriptors)
      : kind_(descriptors.kind), rows_(descriptors.rows), dim_(descriptors.dim) {
    PutDescriptors(descriptors, &bytes_);
  }
  CodedDescriptors view() const { return {kind_, rows_, dim_, bytes_}; }

 private:
  DescriptorKind kind_;
  std::size_t rows_;
  int dim_;
  std::vector<std::uint8_t> bytes_;
};

// The distance by its definition, in double precision.
inline double PlainDistance(const Descriptors& a, std::size_t i, const Descriptors& b,
                            std::size_t j) {
  if (a.kind == DescriptorKind::kFloat) {
    double sum = 0;
    for (int p = 0; p < a.dim; ++p) {
      const double d = static_cast<double>(a.float_row(i)[p]) - b.float_row(j)[p];
      sum += d * d;
    }
    return std::sqrt(sum);
  }
  int bits = 0;
  for (int p = 0; p < a.dim; ++p) {
    for (int x = a.binary_row(i)[p] ^ b.binary_row(j)[p]; x != 0; x &= x - 1) ++bits;
  }
  return bits;
}

}  // namespace pliant::testing
