// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The weights of DEAL (Potje et al., NeurIPS 2021), ready for inference: batch normalisation is
// folded into the layer before it, the first convolution takes one grey channel.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "descriptor/base/safetensors.h"

namespace pliant::deal {

inline constexpr int kNeighbours = 5;      // feature sampler: 5 x 5 cells around a keypoint
inline constexpr int kTpsParameters = 66;  // 63 free weights and 3 affine rows, per axis
inline constexpr int kThetaValues = 2 * kTpsParameters;
inline constexpr int kPatchSide = 32;  // rows = angle, columns = radius
inline constexpr int kPatchPixels = kPatchSide * kPatchSide;

struct ConvLayer {
  int outputs = 0;
  int inputs = 0;
  int kernel_height = 0;
  int kernel_width = 0;
  int stride = 1;
  std::vector<float> weight;  // outputs x inputs x kernel_height x kernel_width
  std::vector<float> bias;    // outputs
};

// A basic block of ResNet (He et al. 2016): relu(conv2(relu(conv1(x))) + shortcut(x)).
struct BasicBlock {
  ConvLayer conv1;
  ConvLayer conv2;
  std::optional<ConvLayer> downsample;  // 1 x 1 on the shortcut; none = identity
};

struct LinearLayer {
  int outputs = 0;
  int inputs = 0;
  std::vector<float> weight;  // outputs x inputs
  std::vector<float> bias;    // outputs
};

// How the rings of the polar grid are spaced; network.h.
enum class RadialSpacing {
  kLinear,       // the paper's
  kLogarithmic,  // each ring is the same factor larger than the one inside it
};

// Widths and depths are the file's; the comments have the paper's, with C = 64.
struct DealWeights {
  ConvLayer stem;                           // 7 x 7, stride 2, 1 -> C
  std::vector<BasicBlock> blocks;           // 3 of C channels, 4 of 2 C
  std::array<LinearLayer, 4> localization;  // 25 * 2 C -> 512 -> 256 -> 256 -> 132
  // 3 x 3 on the polar patch: 32, 32, 64, 64, 128, 128 channels. Strides are 1, but 2 in the second
  // and the fourth layer from the end. There are 6 layers, or 4.
  std::vector<ConvLayer> hardnet;
  // Along the radius, 8 columns to 1: 1 x 3, 1 x 3, 1 x 3, 1 x 2, 128 channels each.
  std::vector<ConvLayer> head;
  double radius_per_size = 0;  // support radius R = this x keypoint size
  RadialSpacing radial_spacing = RadialSpacing::kLinear;
  std::string sha256;  // of the file, 64 hex digits

  int feature_channels() const { return blocks.back().conv2.outputs; }  // of the backbone's map X
  int dim() const { return head.back().outputs; }                       // of a descriptor
};

// Throws kNotFound when there is no such file; kCorrupt naming file and tensor for a malformed
// file, a missing, unknown or wrongly shaped tensor (channels are multiples of 16, half of that in
// the backbone's first stage, up to 1024), a value that is not finite, or metadata
// ("format" = "pliant-deal", "radius_per_size") that is missing or out of range. Without
// "radial_spacing" ("linear" or "logarithmic") the spacing is linear.
DealWeights LoadDealWeights(const std::filesystem::path& path);
DealWeights ParseDealWeights(const SafetensorsFile& file);

}  // namespace pliant::deal
