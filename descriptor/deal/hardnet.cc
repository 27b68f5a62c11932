// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/hardnet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <utility>

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

using dnnl::memory;
using Tag = memory::format_tag;

// Patches that go through all layers but the last together: their maps stay in a core's cache.
constexpr std::size_t kGroup = 4;
static_assert(HardNet::kBatch % kGroup == 0);

std::size_t MapSize(int side, int channels) {
  return static_cast<std::size_t>(side * side) * static_cast<std::size_t>(channels);
}

// Rows of a polar patch are angles, which close to a circle: the row above the first is the last.
// A map with the wrapped row above it, which is all that a stride-2 layer needs.
std::size_t WrappedSize(int side, int channels) {
  return MapSize(side, channels) + static_cast<std::size_t>(side * channels);
}

// 3 x 3, stride 2, on maps with one wrapped row above.
ConvPrimitive StridedConv(const ConvLayer& layer, int side) {
  const auto group = static_cast<memory::dim>(kGroup);
  ConvOptions options;
  options.relu = true;
  options.pad_left = 1;
  return {layer, DenseDesc({group, layer.inputs, side + 1, side}, Tag::nhwc),
          DenseDesc({group, layer.outputs, side / 2, side / 2}, Tag::nhwc), options};
}

ProductPrimitive HeadProduct(const std::vector<ConvLayer>& head) {
  const AffineMap map = FuseHead(head);
  return {{0, static_cast<int>(HardNet::kBatch), map.inputs, map.outputs},
          map.weight,
          /*transposed=*/false,
          map.bias,
          Activation::kNone};
}

// outputs x 1 x 3 x 3 to taps x outputs.
std::vector<float> TapsFirst(const ConvLayer& layer) {
  const auto outputs = static_cast<std::size_t>(layer.outputs);
  std::vector<float> weight(9 * outputs);
  for (std::size_t o = 0; o < outputs; ++o) {
    for (std::size_t t = 0; t < 9; ++t) weight[t * outputs + o] = layer.weight[o * 9 + t];
  }
  return weight;
}

}  // namespace

// A stride-1 layer. A stride-2 layer follows all but the last.
struct HardNet::Stage {
  Stage(const ConvLayer& layer, int map_side)
      : side(map_side),
        inputs(layer.inputs),
        outputs(layer.outputs),
        bias(layer.bias),
        product({kTilePlanes, static_cast<int>(plane_rows()), inputs, outputs},
                WinogradWeights(layer), /*transposed=*/false, {}, Activation::kNone) {}

  std::size_t tiles() const { return MapSize(side / kTileSide, 1); }
  // Patches that go through the product together: of half the side, four times as many.
  std::size_t patches() const { return kBatch * 4 / tiles(); }
  // One row more than the tiles need: planes a power of two apart would all fall into the same set
  // of the cache, which halves the speed of the transforms.
  std::size_t plane_rows() const { return tiles() * patches() + 1; }
  std::size_t plane(int channels) const {
    return plane_rows() * static_cast<std::size_t>(channels);
  }

  int side, inputs, outputs;
  std::vector<float> bias;
  ProductPrimitive product;
};

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

void NormalizeLength(std::span<float> row) {
  double squared = 0;
  for (const float value : row) squared += static_cast<double>(value) * value;
  const auto scale = static_cast<float>(1.0 / std::max(std::sqrt(squared), 1e-12));
  for (float& value : row) value *= scale;
}

HardNet::HardNet(const DealWeights& weights) : HardNet(weights, ScopedPrimitiveThreads(1)) {}

HardNet::HardNet(const DealWeights& weights, const ScopedPrimitiveThreads& /*one*/)
    : first_channels_(weights.hardnet[0].outputs),
      first_stride_(weights.hardnet[0].stride),
      first_weight_(TapsFirst(weights.hardnet[0])),
      first_bias_(weights.hardnet[0].bias),
      head_(HeadProduct(weights.head)) {
  int side = kPatchSide / first_stride_;
  for (std::size_t i = 1; i < weights.hardnet.size(); i += 2, side /= 2) {
    stages_.emplace_back(weights.hardnet[i], side);
    if (i + 1 < weights.hardnet.size())
      strided_.push_back(StridedConv(weights.hardnet[i + 1], side));
  }
}

HardNet::~HardNet() = default;

std::size_t HardNet::scratch_bytes() const {
  std::size_t bytes = head_.scratch_bytes();
  for (const Stage& stage : stages_) bytes = std::max(bytes, stage.product.scratch_bytes());
  for (const ConvPrimitive& conv : strided_) bytes = std::max(bytes, conv.scratch_bytes());
  return bytes;
}

HardNet::Worker::Worker(const HardNet& net)
    : net_(net),
      framed_(kFramedPixels),
      scratch_(net.scratch_bytes() / sizeof(float) + 1),
      result_(kBatch * net.dim()) {
  std::size_t tiles = 0;
  std::size_t products = 0;
  const Stage& last = net.stages_.back();
  for (const Stage& stage : net.stages_) {
    tiles = std::max(tiles, kTilePlanes * stage.plane(stage.inputs));
    products = std::max(products, kTilePlanes * stage.plane(stage.outputs));
    const std::size_t held =
        &stage == &net.stages_.front() ? stage.patches() : (&stage == &last ? kBatch : kGroup);
    inputs_.emplace_back(held * MapSize(stage.side, stage.inputs));
    if (&stage != &last) wrapped_.emplace_back(kGroup * WrappedSize(stage.side, stage.outputs));
  }
  pooled_ = AlignedFloats(kBatch * static_cast<std::size_t>(last.side * last.outputs));
  tiles_ = AlignedFloats(tiles);
  products_ = AlignedFloats(products);
}

void HardNet::Worker::Run(const float* patches, std::size_t count, float* descriptors) {
  const std::size_t last = net_.stages_.size() - 1;
  const Stage& end = net_.stages_[last];
  for (std::size_t first = 0; first < count; first += kGroup) {
    const std::size_t group = std::min(kGroup, count - first);
    for (std::size_t stage = 0; stage < last; ++stage) {
      const Stage& layer = net_.stages_[stage];
      for (std::size_t p = 0; p < group; p += layer.patches()) {
        const std::size_t together = std::min(layer.patches(), group - p);
        float* const input = inputs_[stage].data();
        if (stage == 0) FirstLayer(patches + (first + p) * kPatchPixels, together);
        MultiplyTiles(stage, stage == 0 ? input : input + p * MapSize(layer.side, layer.inputs),
                      together);
        WriteWrapped(stage, p, together);
      }
      float* to = inputs_[stage + 1].data();
      if (stage + 1 == last) to += first * MapSize(end.side, end.inputs);
      RunConv(net_.strided_[stage], wrapped_[stage].data(), to);
    }
  }
  MultiplyTiles(last, inputs_[last].data(), count);
  const std::size_t row = static_cast<std::size_t>(end.side * end.outputs);
  for (std::size_t p = 0; p < count; ++p) {
    kernels_.winograd_pooled(products_.data() + p * end.tiles() * end.outputs, end.side,
                             end.outputs, end.plane(end.outputs), end.bias.data(),
                             pooled_.data() + p * row);
  }
  net_.head_.Run(stream_, pooled_.data(), result_.data(), scratch_.data());
  stream_.wait();
  const std::size_t dim = net_.dim();
  for (std::size_t p = 0; p < count; ++p) NormalizeLength({result_.data() + p * dim, dim});
  std::memcpy(descriptors, result_.data(), count * dim * sizeof(float));
}

void HardNet::Worker::FirstLayer(const float* patches, std::size_t count) {
  const std::size_t size = MapSize(kPatchSide / net_.first_stride_, net_.first_channels_);
  for (std::size_t p = 0; p < count; ++p) {
    kernels_.standardize(patches + p * kPatchPixels, framed_.data());
    kernels_.first_conv(framed_.data(), net_.first_channels_, net_.first_stride_,
                        net_.first_weight_.data(), net_.first_bias_.data(),
                        inputs_[0].data() + p * size);
  }
}

void HardNet::Worker::MultiplyTiles(std::size_t stage, const float* from, std::size_t count) {
  const Stage& layer = net_.stages_[stage];
  const auto inputs = static_cast<std::size_t>(layer.inputs);
  for (std::size_t p = 0; p < count; ++p) {
    kernels_.winograd_input(from + p * MapSize(layer.side, layer.inputs), layer.side, layer.inputs,
                            layer.plane(layer.inputs), tiles_.data() + p * layer.tiles() * inputs);
  }
  layer.product.Run(stream_, tiles_.data(), products_.data(), scratch_.data());
}

// Each map goes below its row 0, which takes a copy of the last row.
void HardNet::Worker::WriteWrapped(std::size_t stage, std::size_t first, std::size_t count) {
  const Stage& layer = net_.stages_[stage];
  const auto outputs = static_cast<std::size_t>(layer.outputs);
  const std::size_t row = static_cast<std::size_t>(layer.side) * outputs;
  for (std::size_t p = 0; p < count; ++p) {
    float* const wrapped =
        wrapped_[stage].data() + (first + p) * WrappedSize(layer.side, layer.outputs);
    kernels_.winograd_output(products_.data() + p * layer.tiles() * outputs, layer.side,
                             layer.outputs, layer.plane(layer.outputs), layer.bias.data(),
                             wrapped + row);
    std::memcpy(wrapped, wrapped + MapSize(layer.side, layer.outputs), row * sizeof(float));
  }
}

void HardNet::Worker::RunConv(const ConvPrimitive& conv, float* source, float* destination) {
  conv.Run(stream_, memory(conv.source_desc(), CpuEngine(), source),
           memory(conv.destination_desc(), CpuEngine(), destination), scratch_.data());
}

}  // namespace pliant::deal
