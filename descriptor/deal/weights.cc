// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/weights.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/sha256.h"
#include "descriptor/base/strings.h"

namespace pliant::deal {
namespace {

constexpr double kBatchNormEpsilon = 1e-5;
constexpr std::int64_t kMaxWidth = 1 << 16;  // of a hidden layer of the localisation network
constexpr std::int64_t kMaxChannels = 1024;
constexpr std::int64_t kChannelStep = 16;  // the kernels take that many at once

using Shape = TensorShape;

[[noreturn]] void Fail(const SafetensorsFile& file, const std::string& fault) {
  throw Error(ErrorCode::kCorrupt, "model_corrupt", file.name() + ": " + fault);
}

// Hands out tensors by name and shape and remembers which ones were asked for.
class TensorSource {
 public:
  explicit TensorSource(const SafetensorsFile& file) : file_(file) {}

  const Shape& ShapeOf(const std::string& name) const {
    const auto found = file_.tensors().find(name);
    if (found == file_.tensors().end()) Fail(file_, "tensor '" + name + "' is missing");
    return found->second.shape;
  }

  // Channels that a convolution gives: a multiple of `step`.
  int OutputsOf(const std::string& conv, std::int64_t step) const {
    const std::string name = conv + ".weight";
    const Shape& shape = ShapeOf(name);
    if (shape.size() != 4 || shape[0] < step || shape[0] % step != 0 || shape[0] > kMaxChannels) {
      Fail(file_, "tensor '" + name + "' should have 4 axes, the first a multiple of " +
                      std::to_string(step) + " up to " + std::to_string(kMaxChannels) + ", found " +
                      ShapeText(shape));
    }
    return static_cast<int>(shape[0]);
  }

  // How many names begin and end so.
  int Count(std::string_view start, std::string_view end) const {
    const auto fits = [&](const auto& tensor) {
      return tensor.first.starts_with(start) && tensor.first.ends_with(end);
    };
    return static_cast<int>(std::count_if(file_.tensors().begin(), file_.tensors().end(), fits));
  }

  std::vector<float> Take(const std::string& name, const Shape& shape) {
    const Shape& found = ShapeOf(name);
    if (found != shape) {
      Fail(file_, "tensor '" + name + "' should have shape " + ShapeText(shape) + ", found " +
                      ShapeText(found));
    }
    taken_.insert(name);
    return file_.Floats(name);
  }

  void RefuseLeftOvers() const {
    for (const auto& [name, info] : file_.tensors()) {
      if (taken_.count(name) == 0) {
        Fail(file_, "tensor '" + name + "' is unknown; not weights of this network?");
      }
    }
  }

  const SafetensorsFile& file() const { return file_; }

 private:
  const SafetensorsFile& file_;
  std::set<std::string> taken_;
};

// conv followed by batch normalisation: y = s (w * x - mean) + b with s = gamma / sqrt(var + eps)
// becomes (s w) * x + (b - s mean). HardNet's normalisations have no gamma and b.
void FoldBatchNorm(TensorSource& source, const std::string& name, bool affine, ConvLayer* layer) {
  const Shape shape = {layer->outputs};
  const std::vector<float> mean = source.Take(name + ".running_mean", shape);
  const std::vector<float> variance = source.Take(name + ".running_var", shape);
  const auto count = static_cast<std::size_t>(layer->outputs);
  std::vector<float> gamma(count, 1.0F);
  std::vector<float> beta(count, 0.0F);
  if (affine) {
    gamma = source.Take(name + ".weight", shape);
    beta = source.Take(name + ".bias", shape);
  }
  const std::size_t row = layer->weight.size() / count;
  layer->bias.resize(count);
  for (std::size_t o = 0; o < count; ++o) {
    if (variance[o] < 0) {
      Fail(source.file(), "tensor '" + name + ".running_var' holds a negative variance");
    }
    const double scale = gamma[o] / std::sqrt(variance[o] + kBatchNormEpsilon);
    for (std::size_t i = 0; i < row; ++i) {
      float& weight = layer->weight[o * row + i];
      weight = static_cast<float>(weight * scale);
    }
    layer->bias[o] = static_cast<float>(beta[o] - scale * mean[o]);
  }
}

ConvLayer TakeConv(TensorSource& source, const std::string& conv, const std::string& norm,
                   bool affine, Shape shape, int stride) {
  ConvLayer layer;
  layer.weight = source.Take(conv + ".weight", shape);
  layer.outputs = static_cast<int>(shape[0]);
  layer.inputs = static_cast<int>(shape[1]);
  layer.kernel_height = static_cast<int>(shape[2]);
  layer.kernel_width = static_cast<int>(shape[3]);
  layer.stride = stride;
  FoldBatchNorm(source, norm, affine, &layer);
  return layer;
}

// The grey image fills all three channels, so w_r * x + w_g * x + w_b * x = (w_r + w_g + w_b) *
// x.
void SumInputChannels(ConvLayer* layer) {
  const std::size_t taps = static_cast<std::size_t>(layer->kernel_height) * layer->kernel_width;
  std::vector<float> summed(static_cast<std::size_t>(layer->outputs) * taps);
  for (std::size_t o = 0; o < static_cast<std::size_t>(layer->outputs); ++o) {
    for (std::size_t t = 0; t < taps; ++t) {
      double sum = 0;
      for (std::size_t c = 0; c < static_cast<std::size_t>(layer->inputs); ++c) {
        sum += layer->weight[(o * layer->inputs + c) * taps + t];
      }
      summed[o * taps + t] = static_cast<float>(sum);
    }
  }
  layer->weight = std::move(summed);
  layer->inputs = 1;
}

std::vector<BasicBlock> TakeBlocks(TensorSource& source, int channels) {
  std::vector<BasicBlock> blocks;
  int inputs = channels;
  for (int stage = 1; stage <= 2; ++stage) {
    const std::string layer = "backbone.layer" + std::to_string(stage) + ".";
    const int count = std::max(source.Count(layer, ".conv1.weight"), 1);
    const int outputs = stage * channels;
    for (int b = 0; b < count; ++b) {
      const std::string name = layer + std::to_string(b) + ".";
      const int stride = stage > 1 && b == 0 ? 2 : 1;
      BasicBlock block;
      block.conv1 =
          TakeConv(source, name + "conv1", name + "bn1", true, {outputs, inputs, 3, 3}, stride);
      block.conv2 =
          TakeConv(source, name + "conv2", name + "bn2", true, {outputs, outputs, 3, 3}, 1);
      if (stride != 1 || inputs != outputs) {
        block.downsample = TakeConv(source, name + "downsample.0", name + "downsample.1", true,
                                    {outputs, inputs, 1, 1}, stride);
      }
      blocks.push_back(std::move(block));
      inputs = outputs;
    }
  }
  return blocks;
}

std::array<LinearLayer, 4> TakeLocalization(TensorSource& source, std::int64_t inputs) {
  std::array<LinearLayer, 4> layers;
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const std::string name = "localization.fc" + std::to_string(i + 1);
    const Shape& shape = source.ShapeOf(name + ".weight");
    const bool last = i + 1 == layers.size();
    if (!last && (shape.size() != 2 || shape[0] < 1 || shape[0] > kMaxWidth)) {
      Fail(source.file(), "tensor '" + name + ".weight' should have shape [width, " +
                              std::to_string(inputs) + "] with width 1 to " +
                              std::to_string(kMaxWidth) + ", found " + ShapeText(shape));
    }
    const std::int64_t outputs = last ? kThetaValues : shape[0];
    layers[i].weight = source.Take(name + ".weight", {outputs, inputs});
    layers[i].bias = source.Take(name + ".bias", {outputs});
    layers[i].inputs = static_cast<int>(inputs);
    layers[i].outputs = static_cast<int>(outputs);
    inputs = outputs;
  }
  return layers;
}

void TakeHardNet(TensorSource& source, DealWeights* weights) {
  const int layers = source.Count("hardnet.conv", ".weight");
  if (layers != 4 && layers != 6) {
    Fail(source.file(), "hardnet should have 4 or 6 convolutions, found " + std::to_string(layers));
  }
  int inputs = 1;
  for (int i = 0; i < layers; ++i) {
    const std::string number = std::to_string(i + 1);
    const std::string name = "hardnet.conv" + number;
    const int outputs = source.OutputsOf(name, kChannelStep);
    const int stride = layers - i == 2 || layers - i == 4 ? 2 : 1;
    weights->hardnet.push_back(
        TakeConv(source, name, "hardnet.bn" + number, false, {outputs, inputs, 3, 3}, stride));
    inputs = outputs;
  }
  std::int64_t columns = kPatchSide / 4;
  for (int i = 0; columns > 1; ++i) {
    const std::string number = std::to_string(i + 1);
    const std::string name = "hardnet.head" + number;
    const Shape& shape = source.ShapeOf(name + ".weight");
    const std::int64_t taps = shape.empty() ? 0 : shape.back();
    if (taps < 2 || taps > columns) {
      Fail(source.file(), "tensor '" + name + ".weight' should cover 2 to " +
                              std::to_string(columns) + " columns, found " + ShapeText(shape));
    }
    const int outputs = source.OutputsOf(name, kChannelStep);
    weights->head.push_back(
        TakeConv(source, name, "hardnet.head_bn" + number, false, {outputs, inputs, 1, taps}, 1));
    columns -= taps - 1;
    inputs = outputs;
  }
}

const std::string& Metadata(const SafetensorsFile& file, const char* key) {
  const auto found = file.metadata().find(key);
  if (found == file.metadata().end()) Fail(file, std::string("metadata '") + key + "' is missing");
  return found->second;
}

double ReadRadiusPerSize(const SafetensorsFile& file) {
  const std::string& text = Metadata(file, "radius_per_size");
  const double value = NumberOf<double>(text).value_or(0);
  if (!(value > 0) || value > 1000) {
    Fail(file, "metadata 'radius_per_size' should be a number in (0, 1000], found '" + text + "'");
  }
  return value;
}

RadialSpacing ReadRadialSpacing(const SafetensorsFile& file) {
  const auto found = file.metadata().find("radial_spacing");
  if (found == file.metadata().end() || found->second == "linear") return RadialSpacing::kLinear;
  if (found->second == "logarithmic") return RadialSpacing::kLogarithmic;
  Fail(file, "metadata 'radial_spacing' should be 'linear' or 'logarithmic', found '" +
                 found->second + "'");
}

// What is wrong with the file is wrong with the model.
template <typename Read>
auto AsModel(Read&& read) {
  try {
    return read();
  } catch (const Error& error) {
    if (error.reason() != "tensor_file_corrupt") throw;
    throw Error(ErrorCode::kCorrupt, "model_corrupt", error.what());
  }
}

DealWeights TakeAll(const SafetensorsFile& file) {
  if (Metadata(file, "format") != "pliant-deal") {
    Fail(file, "metadata 'format' should be 'pliant-deal', found '" + Metadata(file, "format") +
                   "'; not weights of this network");
  }
  DealWeights weights;
  weights.radius_per_size = ReadRadiusPerSize(file);
  weights.radial_spacing = ReadRadialSpacing(file);
  TensorSource source(file);
  const int channels = source.OutputsOf("backbone.conv1", kChannelStep / 2);
  weights.stem = TakeConv(source, "backbone.conv1", "backbone.bn1", true, {channels, 3, 7, 7}, 2);
  SumInputChannels(&weights.stem);
  weights.blocks = TakeBlocks(source, channels);
  weights.localization =
      TakeLocalization(source, kNeighbours * kNeighbours * weights.feature_channels());
  TakeHardNet(source, &weights);
  source.RefuseLeftOvers();
  weights.sha256 = Sha256Hex(file.bytes());
  return weights;
}

}  // namespace

DealWeights LoadDealWeights(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    throw Error(ErrorCode::kNotFound, "model_not_found",
                path.string() + ": no such weight file; give the path of a .safetensors file");
  }
  return ParseDealWeights(AsModel([&] { return SafetensorsFile::Open(path); }));
}

DealWeights ParseDealWeights(const SafetensorsFile& file) {
  return AsModel([&] { return TakeAll(file); });
}

}  // namespace pliant::deal
