// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <cstring>

#include "descriptor/deal/hardnet_body.h"

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
static_assert(HardNetBody::kBatch % kGroup == 0);

// Rows of a polar patch are angles, which close to a circle: the row above the first is the last.
// A map with the wrapped row above it is all that a stride-2 layer needs.
std::size_t WrappedSize(int side, int channels) { return MapSize(side + 1, side, channels); }

// 3 x 3, stride 2, on maps with one wrapped row above.
ConvPrimitive StridedConv(const ConvLayer& layer, int side) {
  const auto group = static_cast<memory::dim>(kGroup);
  ConvOptions options;
  options.relu = true;
  options.pad_left = 1;
  return {layer, DenseDesc({group, layer.inputs, side + 1, side}, Tag::nhwc),
          DenseDesc({group, layer.outputs, side / 2, side / 2}, Tag::nhwc), options};
}

// A stride-1 layer. A stride-2 layer follows all but the last.
struct Stage {
  Stage(const ConvLayer& layer, int map_side)
      : side(map_side),
        inputs(layer.inputs),
        outputs(layer.outputs),
        bias(layer.bias),
        product({kTilePlanes, static_cast<int>(plane_rows()), inputs, outputs},
                WinogradWeights(layer), /*transposed=*/false, {}, Activation::kNone) {}

  std::size_t tiles() const { return MapSize(side / kTileSide, side / kTileSide, 1); }
  // Patches that go through the product together: of half the side, four times as many.
  std::size_t patches() const { return HardNetBody::kBatch * 4 / tiles(); }
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

// The input transform reads the wrapped rows in place, so padding needs no copy; the output
// transform writes the next layer's buffer, of which only the one wrapped row is copied (the
// stride-2 layers are oneDNN convolutions and need it).
class WinogradBody : public HardNetBody {
 public:
  explicit WinogradBody(const DealWeights& weights) : first_(weights.hardnet[0]) {
    const ScopedPrimitiveThreads one(1);
    int side = kPatchSide / first_.stride;
    for (std::size_t i = 1; i < weights.hardnet.size(); i += 2, side /= 2) {
      stages_.emplace_back(weights.hardnet[i], side);
      if (i + 1 < weights.hardnet.size())
        strided_.push_back(StridedConv(weights.hardnet[i + 1], side));
    }
  }

  std::unique_ptr<Worker> MakeWorker() const override;

 private:
  class WinogradWorker;

  std::size_t scratch_bytes() const {
    std::size_t bytes = 0;
    for (const Stage& stage : stages_) bytes = std::max(bytes, stage.product.scratch_bytes());
    for (const ConvPrimitive& conv : strided_) bytes = std::max(bytes, conv.scratch_bytes());
    return bytes;
  }

  FirstLayer first_;
  std::vector<Stage> stages_;
  std::vector<ConvPrimitive> strided_;  // after all stages but the last
};

class WinogradBody::WinogradWorker : public Worker {
 public:
  explicit WinogradWorker(const WinogradBody& net);

  void Run(const float* patches, std::size_t count, float* pooled) override;

 private:
  void RunFirst(const float* patches, std::size_t count);
  void MultiplyTiles(std::size_t stage, const float* from, std::size_t count);
  void WriteWrapped(std::size_t stage, std::size_t first, std::size_t count);

  const WinogradBody& net_;
  const Kernels& kernels_ = BestKernels();
  dnnl::stream stream_{CpuEngine()};
  AlignedFloats framed_, scratch_, tiles_, products_;
  std::vector<AlignedFloats> inputs_, wrapped_;  // of the stride-1 and the stride-2 layers
};

std::unique_ptr<HardNetBody::Worker> WinogradBody::MakeWorker() const {
  return std::make_unique<WinogradWorker>(*this);
}

WinogradBody::WinogradWorker::WinogradWorker(const WinogradBody& net)
    : net_(net), framed_(kFramedPixels), scratch_(net.scratch_bytes() / sizeof(float) + 1) {
  std::size_t tiles = 0;
  std::size_t products = 0;
  const Stage& last = net.stages_.back();
  for (const Stage& stage : net.stages_) {
    tiles = std::max(tiles, kTilePlanes * stage.plane(stage.inputs));
    products = std::max(products, kTilePlanes * stage.plane(stage.outputs));
    const std::size_t held =
        &stage == &net.stages_.front() ? stage.patches() : (&stage == &last ? kBatch : kGroup);
    inputs_.emplace_back(held * MapSize(stage.side, stage.side, stage.inputs));
    if (&stage != &last) wrapped_.emplace_back(kGroup * WrappedSize(stage.side, stage.outputs));
  }
  tiles_ = AlignedFloats(tiles);
  products_ = AlignedFloats(products);
}

void WinogradBody::WinogradWorker::Run(const float* patches, std::size_t count, float* pooled) {
  const std::size_t last = net_.stages_.size() - 1;
  const Stage& end = net_.stages_[last];
  for (std::size_t first = 0; first < count; first += kGroup) {
    const std::size_t group = std::min(kGroup, count - first);
    for (std::size_t stage = 0; stage < last; ++stage) {
      const Stage& layer = net_.stages_[stage];
      for (std::size_t p = 0; p < group; p += layer.patches()) {
        const std::size_t together = std::min(layer.patches(), group - p);
        float* const input = inputs_[stage].data();
        if (stage == 0) RunFirst(patches + (first + p) * kPatchPixels, together);
        MultiplyTiles(
            stage, stage == 0 ? input : input + p * MapSize(layer.side, layer.side, layer.inputs),
            together);
        WriteWrapped(stage, p, together);
      }
      float* to = inputs_[stage + 1].data();
      if (stage + 1 == last) to += first * MapSize(end.side, end.side, end.inputs);
      const ConvPrimitive& conv = net_.strided_[stage];
      conv.Run(stream_, conv.Bind(wrapped_[stage].data(), to, scratch_.data()));
    }
  }
  MultiplyTiles(last, inputs_[last].data(), count);
  const std::size_t row = static_cast<std::size_t>(end.side * end.outputs);
  for (std::size_t p = 0; p < count; ++p) {
    kernels_.winograd_pooled(products_.data() + p * end.tiles() * end.outputs, end.side,
                             end.outputs, end.plane(end.outputs), end.bias.data(),
                             pooled + p * row);
  }
}

void WinogradBody::WinogradWorker::RunFirst(const float* patches, std::size_t count) {
  const std::size_t size = MapSize(kPatchSide / net_.first_.stride, kPatchSide / net_.first_.stride,
                                   net_.first_.channels);
  for (std::size_t p = 0; p < count; ++p) {
    kernels_.standardize(patches + p * kPatchPixels, framed_.data());
    kernels_.first_conv(framed_.data(), net_.first_.channels, net_.first_.stride,
                        net_.first_.weight.data(), net_.first_.bias.data(),
                        inputs_[0].data() + p * size);
  }
}

void WinogradBody::WinogradWorker::MultiplyTiles(std::size_t stage, const float* from,
                                                 std::size_t count) {
  const Stage& layer = net_.stages_[stage];
  const auto inputs = static_cast<std::size_t>(layer.inputs);
  for (std::size_t p = 0; p < count; ++p) {
    kernels_.winograd_input(from + p * MapSize(layer.side, layer.side, layer.inputs), layer.side,
                            layer.inputs, layer.plane(layer.inputs),
                            tiles_.data() + p * layer.tiles() * inputs);
  }
  layer.product.Run(stream_, tiles_.data(), products_.data(), scratch_.data());
}

// Each map goes below its row 0, which takes a copy of the last row.
void WinogradBody::WinogradWorker::WriteWrapped(std::size_t stage, std::size_t first,
                                                std::size_t count) {
  const Stage& layer = net_.stages_[stage];
  const auto outputs = static_cast<std::size_t>(layer.outputs);
  const std::size_t row = static_cast<std::size_t>(layer.side) * outputs;
  for (std::size_t p = 0; p < count; ++p) {
    float* const wrapped =
        wrapped_[stage].data() + (first + p) * WrappedSize(layer.side, layer.outputs);
    kernels_.winograd_output(products_.data() + p * layer.tiles() * outputs, layer.side,
                             layer.outputs, layer.plane(layer.outputs), layer.bias.data(),
                             wrapped + row);
    std::memcpy(wrapped, wrapped + MapSize(layer.side, layer.side, layer.outputs),
                row * sizeof(float));
  }
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

std::unique_ptr<HardNetBody> MakeWinogradBody(const DealWeights& weights) {
  return std::make_unique<WinogradBody>(weights);
}

}  // namespace pliant::deal
