// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/hardnet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <utility>

#include "descriptor/deal/kernels.h"
#include "descriptor/deal/pool.h"
#include "descriptor/deal/primitives.h"

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

// Patches that go through layers 1 to 5 together: their planes and maps stay in a core's cache.
constexpr std::size_t kGroup = 4;
static_assert(HardNet::kBatch % kGroup == 0);

constexpr int kSide2 = 32;  // of the maps that the stride-1 layers 2, 4 and 6 read and write
constexpr int kSide4 = 16;
constexpr int kSide6 = 8;
constexpr int kChannels2 = 32;
constexpr int kChannels4 = 64;
constexpr int kChannels6 = 128;

constexpr std::size_t Tiles(int side) {
  return static_cast<std::size_t>((side / kTileSide) * (side / kTileSide));
}

// One row more than the tiles need: planes a power of two apart would all fall into the same set of
// the cache, which halves the speed of the transforms.
constexpr std::size_t PlaneRows(int side, std::size_t patches) { return Tiles(side) * patches + 1; }

constexpr std::size_t PlaneSize(int side, int channels, std::size_t patches) {
  return PlaneRows(side, patches) * static_cast<std::size_t>(channels);
}

constexpr std::size_t MapSize(int side, int channels) {
  return static_cast<std::size_t>(side) * static_cast<std::size_t>(side * channels);
}

// Rows of a polar patch are angles, which close to a circle: the row above the first is the last.
// A map with the wrapped row above it, which is all that a stride-2 layer needs.
constexpr std::size_t WrappedSize(int side, int channels) {
  return static_cast<std::size_t>(side + 1) * static_cast<std::size_t>(side * channels);
}

// Products of the Winograd planes for `patches` patches.
ProductPrimitive PlaneProduct(const ConvLayer& layer, int side, std::size_t patches) {
  const ProductPrimitive::Shape shape = {kTilePlanes, static_cast<int>(PlaneRows(side, patches)),
                                         layer.inputs, layer.outputs};
  return {shape, WinogradWeights(layer), /*transposed=*/false, {}, Activation::kNone};
}

// Layers 3 and 5: 3 x 3, stride 2, on maps with one wrapped row above.
ConvPrimitive StridedConv(const ConvLayer& layer, int side) {
  const auto group = static_cast<memory::dim>(kGroup);
  ConvOptions options;
  options.relu = true;
  options.pad_left = 1;
  return {layer, DenseDesc({group, layer.inputs, side + 1, side}, Tag::nhwc),
          DenseDesc({group, layer.outputs, side / 2, side / 2}, Tag::nhwc), options};
}

ProductPrimitive HeadProduct(const std::array<ConvLayer, 4>& head) {
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

void NormalizeLength(float* row) {
  double squared = 0;
  for (int i = 0; i < kDescriptorDim; ++i) squared += static_cast<double>(row[i]) * row[i];
  const auto scale = static_cast<float>(1.0 / std::max(std::sqrt(squared), 1e-12));
  for (int i = 0; i < kDescriptorDim; ++i) row[i] *= scale;
}

struct HardNet::Impl {
  explicit Impl(const DealWeights& weights)
      : weight1(TapsFirst(weights.hardnet[0])),
        bias1(weights.hardnet[0].bias),
        bias2(weights.hardnet[1].bias),
        bias4(weights.hardnet[3].bias),
        bias6(weights.hardnet[5].bias),
        product2(PlaneProduct(weights.hardnet[1], kSide2, 1)),
        conv3(StridedConv(weights.hardnet[2], kSide2)),
        product4(PlaneProduct(weights.hardnet[3], kSide4, kGroup)),
        conv5(StridedConv(weights.hardnet[4], kSide4)),
        product6(PlaneProduct(weights.hardnet[5], kSide6, kBatch)),
        head(HeadProduct(weights.head)) {}

  std::size_t scratch_bytes() const {
    return std::max({product2.scratch_bytes(), conv3.scratch_bytes(), product4.scratch_bytes(),
                     conv5.scratch_bytes(), product6.scratch_bytes(), head.scratch_bytes()});
  }

  std::vector<float> weight1;
  std::vector<float> bias1;
  std::vector<float> bias2;
  std::vector<float> bias4;
  std::vector<float> bias6;
  ProductPrimitive product2;
  ConvPrimitive conv3;
  ProductPrimitive product4;
  ConvPrimitive conv5;
  ProductPrimitive product6;
  ProductPrimitive head;
};

struct HardNet::Worker::Impl {
  explicit Impl(const HardNet::Impl& n)
      : net(n),
        map2(kGroup * WrappedSize(kSide2, kChannels2)),
        map3(kGroup * MapSize(kSide4, kChannels4)),
        map4(kGroup * WrappedSize(kSide4, kChannels4)),
        map5(kBatch * MapSize(kSide6, kChannels6)),
        pooled(kBatch * kSide6 * kChannels6),
        scratch(n.scratch_bytes() / sizeof(float) + 1) {
    const std::size_t largest =
        std::max({PlaneSize(kSide2, kChannels2, 1), PlaneSize(kSide4, kChannels4, kGroup),
                  PlaneSize(kSide6, kChannels6, kBatch)});
    tiles = AlignedFloats(kTilePlanes * largest);
    products = AlignedFloats(kTilePlanes * largest);
  }

  void Layers1And2(const float* patch, float* wrapped) {
    constexpr std::size_t kPlane = PlaneSize(kSide2, kChannels2, 1);
    kernels.standardize(patch, framed.data());
    kernels.first_conv(framed.data(), net.weight1.data(), net.bias1.data(), map1.data());
    kernels.winograd_input(map1.data(), kSide2, kChannels2, kPlane, tiles.data());
    net.product2.Run(stream, tiles.data(), products.data(), scratch.data());
    WriteWrapped(products.data(), kSide2, kChannels2, kPlane, net.bias2.data(), wrapped);
  }

  void Layer4(std::size_t count) {
    constexpr std::size_t kTilesValues = Tiles(kSide4) * kChannels4;
    constexpr std::size_t kPlane = PlaneSize(kSide4, kChannels4, kGroup);
    for (std::size_t p = 0; p < count; ++p) {
      kernels.winograd_input(map3.data() + p * MapSize(kSide4, kChannels4), kSide4, kChannels4,
                             kPlane, tiles.data() + p * kTilesValues);
    }
    net.product4.Run(stream, tiles.data(), products.data(), scratch.data());
    for (std::size_t p = 0; p < count; ++p) {
      WriteWrapped(products.data() + p * kTilesValues, kSide4, kChannels4, kPlane, net.bias4.data(),
                   map4.data() + p * WrappedSize(kSide4, kChannels4));
    }
  }

  void Layer6(std::size_t count) {
    constexpr std::size_t kTilesValues = Tiles(kSide6) * kChannels6;
    constexpr std::size_t kPlane = PlaneSize(kSide6, kChannels6, kBatch);
    for (std::size_t p = 0; p < count; ++p) {
      kernels.winograd_input(map5.data() + p * MapSize(kSide6, kChannels6), kSide6, kChannels6,
                             kPlane, tiles.data() + p * kTilesValues);
    }
    net.product6.Run(stream, tiles.data(), products.data(), scratch.data());
    for (std::size_t p = 0; p < count; ++p) {
      kernels.winograd_pooled(products.data() + p * kTilesValues, kSide6, kChannels6, kPlane,
                              net.bias6.data(), pooled.data() + p * kSide6 * kChannels6);
    }
  }

  // The map goes below row 0, which takes a copy of the last row.
  void WriteWrapped(const float* planes, int side, int channels, std::size_t plane,
                    const float* bias, float* wrapped) const {
    const auto row = static_cast<std::size_t>(side) * static_cast<std::size_t>(channels);
    kernels.winograd_output(planes, side, channels, plane, bias, wrapped + row);
    std::memcpy(wrapped, wrapped + static_cast<std::size_t>(side) * row, row * sizeof(float));
  }

  void RunConv(const ConvPrimitive& conv, float* source, float* destination) {
    conv.Run(stream, memory(conv.source_desc(), CpuEngine(), source),
             memory(conv.destination_desc(), CpuEngine(), destination), scratch.data());
  }

  const HardNet::Impl& net;
  const Kernels& kernels = BestKernels();
  dnnl::stream stream{CpuEngine()};
  AlignedFloats framed{kFramedPixels};
  AlignedFloats map1{MapSize(kSide2, kChannels2)};
  AlignedFloats map2;
  AlignedFloats map3;
  AlignedFloats map4;
  AlignedFloats map5;
  AlignedFloats pooled;
  AlignedFloats scratch;
  AlignedFloats tiles;
  AlignedFloats products;
  AlignedFloats result{kBatch * kDescriptorDim};
};

HardNet::HardNet(const DealWeights& weights) {
  const ScopedPrimitiveThreads one(1);
  impl_ = std::make_unique<Impl>(weights);
}

HardNet::~HardNet() = default;

HardNet::Worker::Worker(const HardNet& net) : impl_(std::make_unique<Impl>(*net.impl_)) {}

HardNet::Worker::~Worker() = default;

void HardNet::Worker::Run(const float* patches, std::size_t count, float* descriptors) {
  Impl& worker = *impl_;
  for (std::size_t first = 0; first < count; first += kGroup) {
    const std::size_t group = std::min(kGroup, count - first);
    for (std::size_t p = 0; p < group; ++p) {
      worker.Layers1And2(patches + (first + p) * kPatchPixels,
                         worker.map2.data() + p * WrappedSize(kSide2, kChannels2));
    }
    worker.RunConv(worker.net.conv3, worker.map2.data(), worker.map3.data());
    worker.Layer4(group);
    worker.RunConv(worker.net.conv5, worker.map4.data(),
                   worker.map5.data() + first * MapSize(kSide6, kChannels6));
  }
  worker.Layer6(count);
  worker.net.head.Run(worker.stream, worker.pooled.data(), worker.result.data(),
                      worker.scratch.data());
  worker.stream.wait();
  for (std::size_t p = 0; p < count; ++p) {
    NormalizeLength(worker.result.data() + p * kDescriptorDim);
  }
  std::memcpy(descriptors, worker.result.data(), count * kDescriptorDim * sizeof(float));
}

double HardNet::MultiplyAdds() {
  const double body = 32.0 * 32 * 9 * (32 + 32 * 32) + 16.0 * 16 * 9 * (32 * 64 + 64 * 64) +
                      8.0 * 8 * 9 * (64 * 128 + 128 * 128);
  const double head = 128.0 * 128 * (6 * 3 + 4 * 3 + 2 * 3 + 1 * 2);
  return body + head;
}

}  // namespace pliant::deal
