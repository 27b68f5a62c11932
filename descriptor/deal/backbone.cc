// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/backbone.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "descriptor/deal/onednn.h"
#include "descriptor/deal/pool.h"
#include "descriptor/deal/primitives.h"

namespace pliant::deal {
namespace {

using dnnl::memory;
using Tag = memory::format_tag;

// Buffers that are kept between calls. A network of its size is made for every size of picture.
constexpr std::size_t kIdleBytes = std::size_t{512} << 20;

// Output extent of a kernel of odd size with half of it as padding.
int Strided(int extent, int stride) { return (extent - 1) / stride + 1; }

memory::desc AnyLayout(int channels, int height, int width) {
  return DenseDesc({1, channels, height, width}, Tag::any);
}

ConvOptions SamePadding(const ConvLayer& layer, bool relu, bool add) {
  const int pad = layer.kernel_height / 2;
  return {relu, add, pad, pad, pad, pad};
}

// A basic block for one input shape. The shortcut's buffer takes the result: conv2 adds to it.
struct BlockPrimitives {
  std::optional<ConvPrimitive> downsample;
  std::optional<ConvPrimitive> conv1;
  std::optional<ConvPrimitive> conv2;
  memory hidden;
  memory result;
};

// Everything for one picture size and thread count, run by one caller at a time.
class SizedBackbone {
 public:
  SizedBackbone(const DealWeights& weights, int height, int width, int threads)
      : height_(height), width_(width), threads_(threads), stream_(CpuEngine()) {
    AddStem(weights.stem);
    for (const BasicBlock& block : weights.blocks) AddBlock(block);
    scratch_ = AlignedFloats(scratch_bytes_ / sizeof(float) + 1);
  }

  bool Fits(int height, int width, int threads) const {
    return height == height_ && width == width_ && threads == threads_;
  }

  // Of its buffers.
  std::size_t bytes() const {
    std::size_t sum = scratch_bytes_ + stem_result_.get_desc().get_size();
    const memory* last = nullptr;
    const auto add = [&](const memory& buffer) {
      if (last == nullptr || buffer.get_data_handle() != last->get_data_handle()) {
        sum += buffer.get_desc().get_size();
      }
    };
    add(pooled_);
    last = &pooled_;
    for (const BlockPrimitives& block : blocks_) {
      sum += block.hidden.get_desc().get_size();
      add(block.result);  // or in place of what came before
      last = &block.result;
    }
    return sum;
  }

  FeatureMap Run(const GreyPicture& picture) {
    const memory source(stem_->source_desc(), CpuEngine(),
                        const_cast<float*>(picture.values.data()));
    stem_->Run(stream_, source, stem_result_, scratch_.data());
    pool_.execute(stream_,
                  {{DNNL_ARG_SRC, stem_result_},
                   {DNNL_ARG_DST, pooled_},
                   {DNNL_ARG_SCRATCHPAD, memory(pool_scratch_, CpuEngine(), scratch_.data())}});
    const memory* x = &pooled_;
    for (const BlockPrimitives& block : blocks_) {
      block.conv1->Run(stream_, *x, block.hidden, scratch_.data());
      if (block.downsample) block.downsample->Run(stream_, *x, block.result, scratch_.data());
      block.conv2->Run(stream_, block.hidden, block.result, scratch_.data());
      x = &block.result;
    }
    return ChannelsLast(*x);
  }

 private:
  void AddStem(const ConvLayer& stem) {
    h_ = Strided(height_, 2);
    w_ = Strided(width_, 2);
    stem_.emplace(stem, DenseDesc({1, 1, height_, width_}, Tag::nchw),
                  AnyLayout(stem.outputs, h_, w_), SamePadding(stem, true, false));
    Reserve(*stem_);
    stem_result_ = memory(stem_->destination_desc(), CpuEngine());
    h_ = Strided(h_, 2);
    w_ = Strided(w_, 2);
    dnnl::primitive_attr attributes;
    attributes.set_scratchpad_mode(dnnl::scratchpad_mode::user);
    const dnnl::pooling_forward::primitive_desc description = onednn::MakeMaxPooling(
        CpuEngine(), stem_->destination_desc(), AnyLayout(stem.outputs, h_, w_), {2, 2}, {3, 3},
        {1, 1}, {1, 1}, attributes);
    pool_ = dnnl::pooling_forward(description);
    pool_scratch_ = description.scratchpad_desc();
    scratch_bytes_ = std::max(scratch_bytes_, pool_scratch_.get_size());
    pooled_ = memory(description.dst_desc(), CpuEngine());
    blocks_.reserve(8);
  }

  void AddBlock(const BasicBlock& layers) {
    const memory input = blocks_.empty() ? pooled_ : blocks_.back().result;
    h_ = Strided(h_, layers.conv1.stride);
    w_ = Strided(w_, layers.conv1.stride);
    BlockPrimitives& block = blocks_.emplace_back();
    block.conv1.emplace(layers.conv1, input.get_desc(), AnyLayout(layers.conv1.outputs, h_, w_),
                        SamePadding(layers.conv1, true, false));
    block.hidden = memory(block.conv1->destination_desc(), CpuEngine());
    block.result = input;  // identity shortcut: in place
    if (layers.downsample) {
      block.downsample.emplace(*layers.downsample, input.get_desc(),
                               AnyLayout(layers.downsample->outputs, h_, w_),
                               SamePadding(*layers.downsample, false, false));
      Reserve(*block.downsample);
      block.result = memory(block.downsample->destination_desc(), CpuEngine());
    }
    block.conv2.emplace(layers.conv2, block.conv1->destination_desc(), block.result.get_desc(),
                        SamePadding(layers.conv2, true, true));
    Reserve(*block.conv1);
    Reserve(*block.conv2);
  }

  void Reserve(const ConvPrimitive& primitive) {
    scratch_bytes_ = std::max(scratch_bytes_, primitive.scratch_bytes());
  }

  FeatureMap ChannelsLast(const memory& blocked) {
    FeatureMap map = {h_, w_, height_, width_, {}};
    map.values.resize(static_cast<std::size_t>(h_) * static_cast<std::size_t>(w_) *
                      kFeatureChannels);
    memory from = blocked;
    memory to(DenseDesc({1, kFeatureChannels, h_, w_}, Tag::nhwc), CpuEngine(), map.values.data());
    dnnl::reorder(from, to).execute(stream_, from, to);
    stream_.wait();
    return map;
  }

  const int height_;
  const int width_;
  const int threads_;
  int h_ = 0;  // extent of the layer added last
  int w_ = 0;
  dnnl::stream stream_;
  std::size_t scratch_bytes_ = 0;
  AlignedFloats scratch_;
  std::optional<ConvPrimitive> stem_;
  memory stem_result_;
  dnnl::pooling_forward pool_;
  memory::desc pool_scratch_;
  memory pooled_;
  std::vector<BlockPrimitives> blocks_;
};

}  // namespace

struct Backbone::Impl {
  explicit Impl(std::shared_ptr<const DealWeights> w) : weights(std::move(w)) {}

  std::shared_ptr<const DealWeights> weights;
  Pool<SizedBackbone> pool{kIdleBytes,
                           [](const SizedBackbone& network) { return network.bytes(); }};
};

Backbone::Backbone(std::shared_ptr<const DealWeights> weights)
    : impl_(std::make_unique<Impl>(std::move(weights))) {}

Backbone::~Backbone() = default;

FeatureMap Backbone::Run(const GreyPicture& picture, int threads) const {
  const ScopedPrimitiveThreads scope(threads);
  const auto network = impl_->pool.Take(
      [&](const SizedBackbone& idle) { return idle.Fits(picture.height, picture.width, threads); },
      [&] {
        return std::make_unique<SizedBackbone>(*impl_->weights, picture.height, picture.width,
                                               threads);
      });
  return network->Run(picture);
}

double Backbone::MultiplyAdds(int height, int width) {
  const auto pixels = [&](int divisor) {
    return static_cast<double>(Strided(height, divisor)) * Strided(width, divisor);
  };
  const double stem = pixels(2) * 64 * 49;
  const double first = pixels(4) * 6 * 64 * 64 * 9;
  const double second = pixels(8) * (64 * 128 * 9 + 64 * 128 + 7 * 128 * 128 * 9);
  return stem + first + second;
}

}  // namespace pliant::deal
