// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Binary signatures: the position of a descriptor within its word, in 64 bits. Two descriptors that
// share a word are similar when their signatures differ in few bits.
//
// Hamming embedding (Jegou, Douze and Schmid, ECCV 2008), aggregated over all descriptors of a
// picture that share a word as in ASMK (Tolias, Avrithis and Jegou, ICCV 2013): a descriptor is
// projected on 64 fixed directions, the word's thresholds are subtracted, these residuals are
// summed over the picture's descriptors of the word, and their signs are the bits.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "descriptor/features/features.h"

namespace pliant {

inline constexpr int kSignatureBits = 64;

// The 64 directions for descriptors of one kind and size: random and orthogonal (as far as dim
// allows) for floats, 64 bits drawn at random for binary ones. The same on every machine.
// Immutable and thread-safe.
class SignatureProjection {
 public:
  SignatureProjection(DescriptorKind kind, int dim);

  // Row `row` of `descriptors`, which must be of this kind and size.
  std::array<float, kSignatureBits> operator()(const Descriptors& descriptors,
                                               std::size_t row) const;

 private:
  DescriptorKind kind_;
  int dim_;
  std::vector<float> directions_;    // floats: dim x 64, for contiguous access
  std::vector<std::uint32_t> bits_;  // binary: 64 bit numbers
};

// The thresholds that are subtracted from projections, words x 64 row-major: for each word the mean
// of its projected samples, with the word itself counted once more. `assignment` gives each
// sample's word.
std::vector<float> LearnThresholds(const Descriptors& samples,
                                   std::span<const std::uint32_t> assignment,
                                   const Descriptors& words);

// Sums residuals, then takes signs: bit b is set when component b of the sum is above 0.
class SignatureSum {
 public:
  void Add(const std::array<float, kSignatureBits>& projected, const float* thresholds);
  std::uint64_t Signature() const;

 private:
  std::array<float, kSignatureBits> sum_ = {};
};

}  // namespace pliant
