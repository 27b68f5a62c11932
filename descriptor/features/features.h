// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The value types that all folders share: keypoints and descriptors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "descriptor/features/colour_grid.h"

namespace pliant {

struct Keypoint {
  float x = 0;  // pixels; pixel centres at integers
  float y = 0;
  float size = 0;      // diameter of the meaningful neighbourhood in pixels (OpenCV's SIFT size)
  float angle = 0;     // degrees, 0..360; DEAL does not use it, SIFT does
  float response = 0;  // detector strength
  std::int32_t octave = 0;  // OpenCV's packed SIFT octave; kept for SIFT's own descriptor

  bool operator==(const Keypoint&) const = default;
};

enum class DescriptorKind : std::uint8_t {
  kFloat = 0,   // float components, Euclidean distance
  kBinary = 1,  // bits, Hamming distance
};

// N descriptors of one kind, one row each, row-major and contiguous.
struct Descriptors {
  DescriptorKind kind = DescriptorKind::kFloat;
  int dim = 0;                      // floats (kFloat) or bytes (kBinary) per row
  std::size_t rows = 0;             // N
  std::vector<float> floats;        // N x dim when kFloat, else empty
  std::vector<std::uint8_t> bytes;  // N x dim when kBinary, else empty

  // All values are zero.
  static Descriptors Of(DescriptorKind kind, std::size_t rows, int dim) {
    const bool is_float = kind == DescriptorKind::kFloat;
    return {kind, dim, rows, std::vector<float>(is_float ? rows * dim : 0),
            std::vector<std::uint8_t>(is_float ? 0 : rows * dim)};
  }
  static Descriptors Float(std::size_t rows, int dim) {
    return Of(DescriptorKind::kFloat, rows, dim);
  }
  static Descriptors Binary(std::size_t rows, int dim) {
    return Of(DescriptorKind::kBinary, rows, dim);
  }
  std::span<const float> float_row(std::size_t i) const {
    return {floats.data() + i * dim, static_cast<std::size_t>(dim)};
  }
  std::span<const std::uint8_t> binary_row(std::size_t i) const {
    return {bytes.data() + i * dim, static_cast<std::size_t>(dim)};
  }
  // Adds the rows of `more`, which must have the same kind and dim.
  void Append(const Descriptors& more) {
    rows += more.rows;
    floats.insert(floats.end(), more.floats.begin(), more.floats.end());
    bytes.insert(bytes.end(), more.bytes.begin(), more.bytes.end());
  }
};

// The features of one image. Keypoints are in pixels of the ORIGINAL upright image
// (width x height), regardless of the size at which it was described.
struct Features {
  int width = 0;
  int height = 0;
  std::vector<Keypoint> keypoints;
  Descriptors descriptors;  // row i describes keypoints[i]
  std::string model_id;     // of the descriptors; a mismatch is always an error
  ColourGrid colours = {};  // of the whole image; empty if unknown
  // The whole image, small and grey: a JPEG. Empty if unknown.
  std::vector<std::uint8_t> preview = {};
};

}  // namespace pliant
