// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/signature.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <random>
#include <utility>

namespace pliant {
namespace {

constexpr std::uint64_t kSeed = 0x504C4E54;
constexpr std::size_t kBits = kSignatureBits;

// Roughly normal and, unlike std::normal_distribution, the same with every standard library.
double Draw(std::mt19937_64& random) {
  double sum = -6;
  for (int i = 0; i < 12; ++i) sum += static_cast<double>(random() >> 11) * 0x1.0p-53;
  return sum;
}

double Dot(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

// kBits unit vectors; the first dim of them are orthogonal (Gram-Schmidt).
std::vector<float> Directions(std::size_t dim) {
  std::mt19937_64 random(kSeed);
  std::vector<std::vector<double>> rows;
  for (std::size_t b = 0; b < kBits; ++b) {
    std::vector<double> row(dim);
    for (double& value : row) value = Draw(random);
    if (b < dim) {
      for (const auto& earlier : rows) {
        const double along = Dot(row, earlier);
        for (std::size_t d = 0; d < dim; ++d) row[d] -= along * earlier[d];
      }
    }
    const double norm = std::sqrt(Dot(row, row));
    for (double& value : row) value /= norm;
    rows.push_back(std::move(row));
  }
  std::vector<float> by_component(dim * kBits);
  for (std::size_t b = 0; b < kBits; ++b) {
    for (std::size_t d = 0; d < dim; ++d) {
      by_component[d * kBits + b] = static_cast<float>(rows[b][d]);
    }
  }
  return by_component;
}

// kBits different bit numbers below `count`, or each as often as it takes.
std::vector<std::uint32_t> ChooseBits(std::size_t count) {
  std::mt19937_64 random(kSeed);
  std::vector<std::uint32_t> all(count);
  std::iota(all.begin(), all.end(), 0U);
  for (std::size_t i = count; i > 1; --i) std::swap(all[i - 1], all[random() % i]);
  std::vector<std::uint32_t> chosen(kBits);
  for (std::size_t b = 0; b < kBits; ++b) chosen[b] = all[b % count];
  return chosen;
}

}  // namespace

SignatureProjection::SignatureProjection(DescriptorKind kind, int dim) : kind_(kind), dim_(dim) {
  if (dim <= 0) return;
  if (kind == DescriptorKind::kFloat) {
    directions_ = Directions(static_cast<std::size_t>(dim));
  } else {
    bits_ = ChooseBits(static_cast<std::size_t>(dim) * 8);
  }
}

std::array<float, kSignatureBits> SignatureProjection::operator()(const Descriptors& descriptors,
                                                                  std::size_t row) const {
  std::array<float, kSignatureBits> projected = {};
  if (kind_ == DescriptorKind::kBinary) {
    const auto bytes = descriptors.binary_row(row);
    for (std::size_t b = 0; b < kBits; ++b) {
      projected[b] = static_cast<float>(bytes[bits_[b] / 8] >> (bits_[b] % 8) & 1);
    }
    return projected;
  }
  const auto values = descriptors.float_row(row);
  for (std::size_t d = 0; d < values.size(); ++d) {
    const float* direction = directions_.data() + d * kBits;
    for (std::size_t b = 0; b < kBits; ++b) projected[b] += values[d] * direction[b];
  }
  return projected;
}

std::vector<float> LearnThresholds(const Descriptors& samples,
                                   std::span<const std::uint32_t> assignment,
                                   const Descriptors& words) {
  const SignatureProjection project(words.kind, words.dim);
  std::vector<double> sums(words.rows * kBits, 0.0);
  std::vector<double> counts(words.rows, 0.0);
  const auto add = [&](const Descriptors& from, std::size_t row, std::size_t word) {
    const auto projected = project(from, row);
    for (std::size_t b = 0; b < kBits; ++b) sums[word * kBits + b] += projected[b];
    counts[word] += 1;
  };
  for (std::size_t w = 0; w < words.rows; ++w) add(words, w, w);
  for (std::size_t i = 0; i < assignment.size(); ++i) add(samples, i, assignment[i]);
  std::vector<float> thresholds(sums.size());
  for (std::size_t i = 0; i < sums.size(); ++i) {
    thresholds[i] = static_cast<float>(sums[i] / counts[i / kBits]);
  }
  return thresholds;
}

void SignatureSum::Add(const std::array<float, kSignatureBits>& projected,
                       const float* thresholds) {
  for (std::size_t b = 0; b < kBits; ++b) sum_[b] += projected[b] - thresholds[b];
}

std::uint64_t SignatureSum::Signature() const {
  std::uint64_t bits = 0;
  for (std::size_t b = 0; b < kBits; ++b) bits |= std::uint64_t{sum_[b] > 0} << b;
  return bits;
}

}  // namespace pliant
