// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "descriptor/deal/hardnet_body.h"

namespace pliant::deal {
namespace {

using dnnl::memory;
using Tag = memory::format_tag;
using Type = memory::data_type;

// A layer after the first. Rows of a polar patch are angles, which close to a circle: its input has
// a copy of the last row above the first and, with stride 1, one of the first row below the last.
// Patches pass one at a time: their maps stay in the cache, and each layer writes into the next
// one's input, below the row that is copied (oneDNN cannot leave rows out between several patches).
struct Layer {
  Layer(const ConvLayer& weights, int input_side, bool is_last)
      : side(input_side),
        inputs(weights.inputs),
        below(weights.stride == 1 ? 1 : 0),
        conv(weights, DenseDesc({1, inputs, 1 + side + below, side}, Tag::nhwc, Type::bf16),
             DenseDesc({1, weights.outputs, side / weights.stride, side / weights.stride},
                       Tag::nhwc, is_last ? Type::f32 : Type::bf16),
             Padding(below)) {}

  static ConvOptions Padding(int right) {
    ConvOptions options;
    options.relu = true;
    options.pad_left = 1;
    options.pad_right = right;
    return options;
  }

  std::size_t row() const { return MapSize(1, side, inputs); }
  std::size_t input_size() const { return MapSize(1 + side + below, side, inputs); }

  int side, inputs, below;
  ConvPrimitive conv;
};

class DirectBody : public HardNetBody {
 public:
  explicit DirectBody(const DealWeights& weights)
      : first_(weights.hardnet[0]), columns_(kPatchSide / first_.stride) {
    const ScopedPrimitiveThreads one(1);
    for (std::size_t i = 1; i < weights.hardnet.size(); ++i) {
      layers_.emplace_back(weights.hardnet[i], columns_, i + 1 == weights.hardnet.size());
      columns_ /= weights.hardnet[i].stride;
    }
    channels_ = weights.hardnet.back().outputs;
  }

  std::unique_ptr<Worker> MakeWorker() const override;

 private:
  class DirectWorker;

  FirstLayer first_;
  int columns_;  // and rows, of the last map
  int channels_ = 0;
  std::vector<Layer> layers_;
};

class DirectBody::DirectWorker : public Worker {
 public:
  explicit DirectWorker(const DirectBody& body)
      : body_(body),
        framed_(kFramedPixels),
        last_(MapSize(body.columns_, body.columns_, body.channels_)) {
    std::size_t scratch = 0;
    for (const Layer& layer : body.layers_) {
      inputs_.emplace_back(layer.input_size());
      scratch = std::max(scratch, layer.conv.scratch_bytes());
    }
    scratch_ = AlignedFloats(scratch / sizeof(float) + 1);
    for (std::size_t i = 0; i < body.layers_.size(); ++i) {
      void* const to = i + 1 < body.layers_.size()
                           ? static_cast<void*>(inputs_[i + 1].data() + body.layers_[i + 1].row())
                           : last_.data();
      arguments_.push_back(body.layers_[i].conv.Bind(inputs_[i].data(), to, scratch_.data()));
    }
  }

  void Run(const float* patches, std::size_t count, float* pooled) override {
    const std::size_t row = MapSize(1, body_.columns_, body_.channels_);
    for (std::size_t p = 0; p < count; ++p) {
      RunOne(patches + p * kPatchPixels);
      MeanOfRows(row, pooled + p * row);
    }
  }

 private:
  void RunOne(const float* patch) {
    kernels_.standardize(patch, framed_.data());
    kernels_.first_conv_bfloat16(framed_.data(), body_.first_.channels, body_.first_.stride,
                                 body_.first_.weight.data(), body_.first_.bias.data(),
                                 inputs_[0].data() + body_.layers_[0].row());
    for (std::size_t i = 0; i < body_.layers_.size(); ++i) {
      const Layer& layer = body_.layers_[i];
      const auto rows = static_cast<std::size_t>(layer.side) * layer.row();
      std::uint16_t* const input = inputs_[i].data();
      std::memcpy(input, input + rows, layer.row() * sizeof(*input));
      if (layer.below > 0) {
        std::memcpy(input + layer.row() + rows, input + layer.row(), layer.row() * sizeof(*input));
      }
      layer.conv.Run(stream_, arguments_[i]);
    }
    stream_.wait();
  }

  void MeanOfRows(std::size_t row, float* mean) const {
    const float share = 1.0F / static_cast<float>(body_.columns_);
    std::fill_n(mean, row, 0.0F);
    for (const float* from = last_.data(); from != last_.data() + last_.size(); from += row) {
      for (std::size_t i = 0; i < row; ++i) mean[i] += share * from[i];
    }
  }

  const DirectBody& body_;
  const Kernels& kernels_ = BestKernels();
  dnnl::stream stream_{CpuEngine()};
  AlignedFloats framed_, last_, scratch_;
  std::vector<AlignedArray<std::uint16_t>> inputs_;
  std::vector<ConvPrimitive::Arguments> arguments_;
};

std::unique_ptr<HardNetBody::Worker> DirectBody::MakeWorker() const {
  return std::make_unique<DirectWorker>(*this);
}

}  // namespace

std::unique_ptr<HardNetBody> MakeDirectBody(const DealWeights& weights) {
  return std::make_unique<DirectBody>(weights);
}

}  // namespace pliant::deal
