// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/winograd.h"

#include <cstddef>
#include <utility>

#include "descriptor/deal/kernels.h"

namespace pliant::deal {
namespace {

// Toom and Cook's scheme at the points 0, 1, -1, 2, -2 and infinity (Lavin and Gray 2016, section
// 4.3): 36 products for 4 x 4 outputs instead of 144. In double, for the sixths are not exact.
constexpr double kG[6][3] = {{1.0 / 4, 0, 0},
                             {-1.0 / 6, -1.0 / 6, -1.0 / 6},
                             {-1.0 / 6, 1.0 / 6, -1.0 / 6},
                             {1.0 / 24, 1.0 / 12, 1.0 / 6},
                             {1.0 / 24, -1.0 / 12, 1.0 / 6},
                             {0, 0, 1}};

}  // namespace

std::vector<float> WinogradWeights(const ConvLayer& layer) {
  const auto outputs = static_cast<std::size_t>(layer.outputs);
  const auto inputs = static_cast<std::size_t>(layer.inputs);
  std::vector<float> planes(kTilePlanes * inputs * outputs);
  for (std::size_t o = 0; o < outputs; ++o) {
    for (std::size_t i = 0; i < inputs; ++i) {
      const float* g = layer.weight.data() + (o * inputs + i) * 9;
      for (std::size_t p = 0; p < kTilePlanes; ++p) {
        double sum = 0;
        for (std::size_t r = 0; r < 3; ++r) {
          for (std::size_t c = 0; c < 3; ++c) {
            sum += kG[p / 6][r] * kG[p % 6][c] * static_cast<double>(g[r * 3 + c]);
          }
        }
        planes[(p * inputs + i) * outputs + o] = static_cast<float>(sum);
      }
    }
  }
  return planes;
}

// The head has no activation between its layers, and affine maps make one affine map. From the last
// layer back: with y = R x + b so far and x = w * u + a below it, the window of
// column j takes taps j .. j + kernel - 1 of u.
AffineMap FuseHead(const std::array<ConvLayer, 4>& head) {
  const auto outputs = static_cast<std::size_t>(head.back().outputs);
  std::size_t columns = 1;
  std::size_t channels = outputs;
  std::vector<double> map(channels * outputs, 0.0);  // (columns x channels) x outputs
  std::vector<double> bias(outputs, 0.0);
  for (std::size_t o = 0; o < outputs; ++o) map[o * outputs + o] = 1.0;
  for (auto layer = head.rbegin(); layer != head.rend(); ++layer) {
    const auto taps = static_cast<std::size_t>(layer->kernel_width);
    const auto below = static_cast<std::size_t>(layer->inputs);
    std::vector<double> lower((columns + taps - 1) * below * outputs, 0.0);
    for (std::size_t j = 0; j < columns; ++j) {
      for (std::size_t c = 0; c < channels; ++c) {
        const double* row = map.data() + (j * channels + c) * outputs;
        for (std::size_t f = 0; f < outputs; ++f) {
          bias[f] += static_cast<double>(layer->bias[c]) * row[f];
        }
        for (std::size_t i = 0; i < below; ++i) {
          for (std::size_t t = 0; t < taps; ++t) {
            const double weight = layer->weight[(c * below + i) * taps + t];
            double* to = lower.data() + ((j + t) * below + i) * outputs;
            for (std::size_t f = 0; f < outputs; ++f) to[f] += weight * row[f];
          }
        }
      }
    }
    map = std::move(lower);
    columns += taps - 1;
    channels = below;
  }
  return {static_cast<int>(columns * channels), static_cast<int>(outputs),
          std::vector<float>(map.begin(), map.end()), std::vector<float>(bias.begin(), bias.end())};
}

}  // namespace pliant::deal
