// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Weights for Winograd's F(4x4, 3x3) convolution and for HardNet's linear head. Internal to deal/.
#pragma once

#include <array>
#include <vector>

#include "descriptor/deal/weights.h"

namespace pliant::deal {

// G g G^T (Lavin and Gray 2016, section 4.3): kTilePlanes matrices of inputs x outputs.
std::vector<float> WinogradWeights(const ConvLayer& layer);

// An affine map from `inputs` to `outputs` values, weight inputs x outputs.
struct AffineMap {
  int inputs = 0;
  int outputs = 0;
  std::vector<float> weight;
  std::vector<float> bias;
};

// The layers of the head as one map from columns x channels values, channels fastest.
AffineMap FuseHead(const std::array<ConvLayer, 4>& head);

}  // namespace pliant::deal
