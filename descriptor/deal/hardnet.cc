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

// The maps that a stride-1 layer reads and writes, for the patches that go through it together.
struct HardNet::Maps {
  int side;
  int channels;
  std::size_t patches;

  constexpr std::size_t row() const { return static_cast<std::size_t>(side * channels); }
  constexpr std::size_t size() const { return static_cast<std::size_t>(side) * row(); }
  // Rows of a polar patch are angles, which close to a circle: the row above the first is the last.
  // A map with the wrapped row above it, which is all that a stride-2 layer needs.
  constexpr std::size_t wrapped_size() const { return size() + row(); }
  constexpr std::size_t tiles() const {
    return static_cast<std::size_t>((side / kTileSide) * (side / kTileSide));
  }
  // Of one patch in a plane.
  constexpr std::size_t tile_values() const { return tiles() * static_cast<std::size_t>(channels); }
  // One row more than the tiles need: planes a power of two apart would all fall into the same set
  // of the cache, which halves the speed of the transforms.
  constexpr std::size_t plane_rows() const { return tiles() * patches + 1; }
  constexpr std::size_t plane() const { return plane_rows() * static_cast<std::size_t>(channels); }
};

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

constexpr HardNet::Maps kMaps2{32, 32, 1};
constexpr HardNet::Maps kMaps4{16, 64, kGroup};
constexpr HardNet::Maps kMaps6{8, 128, HardNet::kBatch};

ProductPrimitive PlaneProduct(const ConvLayer& layer, const HardNet::Maps& maps) {
  const ProductPrimitive::Shape shape = {kTilePlanes, static_cast<int>(maps.plane_rows()),
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

HardNet::HardNet(const DealWeights& weights) : HardNet(weights, ScopedPrimitiveThreads(1)) {}

HardNet::HardNet(const DealWeights& weights, const ScopedPrimitiveThreads& /*one*/)
    : weight1_(TapsFirst(weights.hardnet[0])),
      bias1_(weights.hardnet[0].bias),
      bias2_(weights.hardnet[1].bias),
      bias4_(weights.hardnet[3].bias),
      bias6_(weights.hardnet[5].bias),
      product2_(PlaneProduct(weights.hardnet[1], kMaps2)),
      conv3_(StridedConv(weights.hardnet[2], kMaps2.side)),
      product4_(PlaneProduct(weights.hardnet[3], kMaps4)),
      conv5_(StridedConv(weights.hardnet[4], kMaps4.side)),
      product6_(PlaneProduct(weights.hardnet[5], kMaps6)),
      head_(HeadProduct(weights.head)) {}

std::size_t HardNet::scratch_bytes() const {
  return std::max({product2_.scratch_bytes(), conv3_.scratch_bytes(), product4_.scratch_bytes(),
                   conv5_.scratch_bytes(), product6_.scratch_bytes(), head_.scratch_bytes()});
}

HardNet::Worker::Worker(const HardNet& net)
    : net_(net),
      framed_(kFramedPixels),
      map1_(kMaps2.size()),
      map2_(kGroup * kMaps2.wrapped_size()),
      map3_(kGroup * kMaps4.size()),
      map4_(kGroup * kMaps4.wrapped_size()),
      map5_(kBatch * kMaps6.size()),
      pooled_(kBatch * kMaps6.row()),
      scratch_(net.scratch_bytes() / sizeof(float) + 1),
      tiles_(kTilePlanes * std::max({kMaps2.plane(), kMaps4.plane(), kMaps6.plane()})),
      products_(tiles_.size()),
      result_(kBatch * kDescriptorDim) {}

void HardNet::Worker::Run(const float* patches, std::size_t count, float* descriptors) {
  for (std::size_t first = 0; first < count; first += kGroup) {
    const std::size_t group = std::min(kGroup, count - first);
    for (std::size_t p = 0; p < group; ++p) {
      Layers1And2(patches + (first + p) * kPatchPixels, map2_.data() + p * kMaps2.wrapped_size());
    }
    RunConv(net_.conv3_, map2_.data(), map3_.data());
    Layer4(group);
    RunConv(net_.conv5_, map4_.data(), map5_.data() + first * kMaps6.size());
  }
  Layer6(count);
  net_.head_.Run(stream_, pooled_.data(), result_.data(), scratch_.data());
  stream_.wait();
  for (std::size_t p = 0; p < count; ++p) NormalizeLength(result_.data() + p * kDescriptorDim);
  std::memcpy(descriptors, result_.data(), count * kDescriptorDim * sizeof(float));
}

void HardNet::Worker::Layers1And2(const float* patch, float* wrapped) {
  kernels_.standardize(patch, framed_.data());
  kernels_.first_conv(framed_.data(), net_.weight1_.data(), net_.bias1_.data(), map1_.data());
  MultiplyTiles(net_.product2_, map1_.data(), kMaps2, 1);
  WriteWrapped(products_.data(), kMaps2, net_.bias2_.data(), wrapped);
}

void HardNet::Worker::Layer4(std::size_t count) {
  MultiplyTiles(net_.product4_, map3_.data(), kMaps4, count);
  for (std::size_t p = 0; p < count; ++p) {
    WriteWrapped(products_.data() + p * kMaps4.tile_values(), kMaps4, net_.bias4_.data(),
                 map4_.data() + p * kMaps4.wrapped_size());
  }
}

void HardNet::Worker::Layer6(std::size_t count) {
  MultiplyTiles(net_.product6_, map5_.data(), kMaps6, count);
  for (std::size_t p = 0; p < count; ++p) {
    kernels_.winograd_pooled(products_.data() + p * kMaps6.tile_values(), kMaps6.side,
                             kMaps6.channels, kMaps6.plane(), net_.bias6_.data(),
                             pooled_.data() + p * kMaps6.row());
  }
}

void HardNet::Worker::MultiplyTiles(const ProductPrimitive& product, const float* from,
                                    const Maps& maps, std::size_t count) {
  for (std::size_t p = 0; p < count; ++p) {
    kernels_.winograd_input(from + p * maps.size(), maps.side, maps.channels, maps.plane(),
                            tiles_.data() + p * maps.tile_values());
  }
  product.Run(stream_, tiles_.data(), products_.data(), scratch_.data());
}

// The map goes below row 0, which takes a copy of the last row.
void HardNet::Worker::WriteWrapped(const float* planes, const Maps& maps, const float* bias,
                                   float* wrapped) const {
  kernels_.winograd_output(planes, maps.side, maps.channels, maps.plane(), bias,
                           wrapped + maps.row());
  std::memcpy(wrapped, wrapped + maps.size(), maps.row() * sizeof(float));
}

void HardNet::Worker::RunConv(const ConvPrimitive& conv, float* source, float* destination) {
  conv.Run(stream_, memory(conv.source_desc(), CpuEngine(), source),
           memory(conv.destination_desc(), CpuEngine(), destination), scratch_.data());
}

}  // namespace pliant::deal
