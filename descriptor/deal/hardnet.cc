// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/hardnet.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <utility>

namespace pliant::deal {

namespace {

using dnnl::memory;

// An affine map from `inputs` to `outputs` values, weight inputs x outputs.
struct AffineMap {
  int inputs = 0;
  int outputs = 0;
  std::vector<float> weight;
  std::vector<float> bias;
};

// As one map from columns x channels values, channels fastest: the head has no activation between
// its layers, and affine maps make one affine map. From the last layer back: with y = R x + b so
// far and x = w * u + a below it, the window of column j takes taps j .. j + kernel - 1 of u.
AffineMap FuseHead(const std::vector<ConvLayer>& head) {
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

ProductPrimitive HeadProduct(const std::vector<ConvLayer>& head) {
  const ScopedPrimitiveThreads one(1);
  const AffineMap map = FuseHead(head);
  return {{0, static_cast<int>(HardNet::kBatch), map.inputs, map.outputs},
          map.weight,
          /*transposed=*/false,
          map.bias,
          Activation::kNone};
}

}  // namespace

FirstLayer::FirstLayer(const ConvLayer& layer)
    : channels(layer.outputs), stride(layer.stride), weight(layer.weight.size()), bias(layer.bias) {
  const std::size_t outputs = bias.size();  // from outputs x 9
  for (std::size_t i = 0; i < weight.size(); ++i) {
    weight[i] = layer.weight[i % outputs * 9 + i / outputs];
  }
}

void NormalizeLength(std::span<float> row) {
  double squared = 0;
  for (const float value : row) squared += static_cast<double>(value) * value;
  const auto scale = static_cast<float>(1.0 / std::max(std::sqrt(squared), 1e-12));
  for (float& value : row) value *= scale;
}

HardNet::HardNet(const DealWeights& weights, memory::data_type type)
    : body_(type == memory::data_type::bf16 ? MakeDirectBody(weights) : MakeWinogradBody(weights)),
      head_(HeadProduct(weights.head)) {}

HardNet::Worker::Worker(const HardNet& net)
    : net_(net),
      body_(net.body_->MakeWorker()),
      pooled_(kBatch * static_cast<std::size_t>(net.head_.shape().inner)),
      scratch_(net.head_.scratch_bytes() / sizeof(float) + 1),
      result_(kBatch * net.dim()) {}

void HardNet::Worker::Run(const float* patches, std::size_t count, float* descriptors) {
  body_->Run(patches, count, pooled_.data());
  net_.head_.Run(stream_, pooled_.data(), result_.data(), scratch_.data());
  stream_.wait();
  const std::size_t dim = net_.dim();
  for (std::size_t p = 0; p < count; ++p) NormalizeLength({result_.data() + p * dim, dim});
  std::memcpy(descriptors, result_.data(), count * dim * sizeof(float));
}

}  // namespace pliant::deal
