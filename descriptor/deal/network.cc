// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/network.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/deal/kernels.h"
#include "descriptor/deal/primitives.h"
#include "descriptor/deal/weights.h"

namespace pliant::deal {
namespace {

constexpr int kControlStride = 4;  // every fourth row and column is a control point: 8 x 8
constexpr double kBoxScale = 0.3;  // the share of the unit square that the grid occupies

using Point = std::array<double, 2>;

double RingRadius(RadialSpacing spacing, int ring) {
  const double share = (ring + 0.5) / kPatchSide;
  return spacing == RadialSpacing::kLinear ? share : std::pow(kPatchSide, share - 1);
}

std::vector<Point> Grid(RadialSpacing spacing) {
  std::vector<Point> grid;
  grid.reserve(kPatchPixels);
  for (int i = 0; i < kPatchSide; ++i) {
    const double angle = 2 * std::numbers::pi * (i + 0.5) / kPatchSide;
    for (int j = 0; j < kPatchSide; ++j) {
      const double radius = RingRadius(spacing, j);
      grid.push_back({radius * std::cos(angle), radius * std::sin(angle)});
    }
  }
  return grid;
}

double HalfWidth() {
  double half = 0;
  for (const Point& p : Grid(RadialSpacing::kLinear)) half = std::max(half, std::abs(p[0]));
  return half;
}

std::vector<Point> InBox(std::vector<Point> points) {
  const double half = HalfWidth();
  for (Point& point : points) {
    for (double& value : point) value = (value / half + 1) / 2 * kBoxScale + (1 - kBoxScale) / 2;
  }
  return points;
}

double Rho(const Point& a, const Point& b) {
  const double squared = (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]);
  return squared * std::log(std::sqrt(squared) + 1e-6);
}

using dnnl::memory;
using Tag = memory::format_tag;
using Type = memory::data_type;

// Buffers and oneDNN primitives that are kept between calls: a network of its size is made for
// every size of image. oneDNN's own limit of 1024 primitives takes gigabytes for photos of many
// sizes.
constexpr int kKeptPrimitives = 128;
constexpr std::size_t kIdleBytes = std::size_t{64} << 20;

// Output extent of a kernel of odd size with half of it as padding.
int Strided(int extent, int stride) { return (extent - 1) / stride + 1; }

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

// Keypoints a product. The first layer's 6.5 MB of weights are read once a batch, so the large
// batch is large; the small one serves images with few keypoints and the remainder.
constexpr std::size_t kLargeBatch = 128;
constexpr std::size_t kSmallBatch = 16;

constexpr std::size_t kBatch = HardNet::kBatch;
constexpr std::size_t kShiftValues = 2 * kPatchPixels;  // x values, then y values

// body(first, count) for each `step` keypoints.
template <typename Body>
void ForEach(std::size_t step, std::size_t total, int threads, const Body& body) {
  ParallelFor((total + step - 1) / step, threads, [&](std::size_t i) {
    const ScopedPrimitiveThreads one(1);
    body(i * step, std::min(step, total - i * step));
  });
}

// Throws kInvalidArgument naming the first keypoint that is not finite or has no positive size.
void CheckKeypoints(std::span<const Keypoint> keypoints) {
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const Keypoint& point = keypoints[i];
    if (!std::isfinite(point.x) || !std::isfinite(point.y) || !std::isfinite(point.size) ||
        !(point.size > 0)) {
      throw Error(
          ErrorCode::kInvalidArgument, "keypoint_invalid",
          "keypoint " + std::to_string(i) + " needs a finite place and a finite size above 0");
    }
  }
}

ProductPrimitive WarpProduct(RadialSpacing spacing) {
  const ScopedPrimitiveThreads one(1);
  std::vector<float> basis = TpsBasis(spacing);
  const double gain = DisplacementGain();
  for (float& value : basis) value = static_cast<float>(gain * value);  // in units of R
  return {{0, static_cast<int>(2 * kBatch), kTpsParameters, kPatchPixels},
          basis,
          /*transposed=*/true,
          {},
          Activation::kNone};
}

}  // namespace

// Everything for one image size and thread count, run by one caller at a time.
class SizedBackbone {
 public:
  SizedBackbone(const DealWeights& weights, memory::data_type type, int height, int width,
                int threads)
      : type_(type),
        height_(height),
        width_(width),
        threads_(threads),
        channels_(weights.feature_channels()),
        stream_(CpuEngine()) {
    AddStem(weights.stem);
    blocks_.reserve(weights.blocks.size());
    for (const BasicBlock& block : weights.blocks) AddBlock(block);
    scratch_ = AlignedFloats(scratch_bytes_ / sizeof(float) + 1);
  }

  bool Fits(int height, int width, int threads) const {
    return height == height_ && width == width_ && threads == threads_;
  }

  // Of its buffers.
  std::size_t bytes() const { return scratch_bytes_ + buffer_bytes_; }

  FeatureMap Run(const GreyImage& image) {
    Run(*stem_, const_cast<float*>(image.values.data()), stem_result_);
    pool_.execute(stream_,
                  {{DNNL_ARG_SRC, stem_result_},
                   {DNNL_ARG_DST, pooled_},
                   {DNNL_ARG_SCRATCHPAD, memory(pool_scratch_, CpuEngine(), scratch_.data())}});
    if (type_ != Type::f32) dnnl::reorder(pooled_, input_).execute(stream_, pooled_, input_);
    const memory* x = &input_;
    for (const BlockPrimitives& block : blocks_) {
      Run(*block.conv1, x->get_data_handle(), block.hidden);
      if (block.downsample) Run(*block.downsample, x->get_data_handle(), block.result);
      Run(*block.conv2, block.hidden.get_data_handle(), block.result);
      x = &block.result;
    }
    return ChannelsLast(*x);
  }

 private:
  void Run(const ConvPrimitive& conv, void* source, const memory& destination) {
    conv.Run(stream_, conv.Bind(source, destination.get_data_handle(), scratch_.data()));
  }

  void AddStem(const ConvLayer& stem) {
    h_ = Strided(height_, 2);
    w_ = Strided(width_, 2);
    stem_.emplace(stem, DenseDesc({1, 1, height_, width_}, Tag::nchw),
                  DenseDesc({1, stem.outputs, h_, w_}, Tag::any), SamePadding(stem, true, false));
    Reserve(*stem_);
    stem_result_ = MakeBuffer(stem_->destination_desc());
    h_ = Strided(h_, 2);
    w_ = Strided(w_, 2);
    const dnnl::pooling_forward::primitive_desc description = onednn::MakeMaxPooling(
        CpuEngine(), stem_->destination_desc(), DenseDesc({1, stem.outputs, h_, w_}, Tag::any),
        {2, 2}, {3, 3}, {1, 1}, {1, 1}, ScratchByCaller());
    pool_ = dnnl::pooling_forward(description);
    pool_scratch_ = description.scratchpad_desc();
    scratch_bytes_ = std::max(scratch_bytes_, pool_scratch_.get_size());
    pooled_ = MakeBuffer(description.dst_desc());
    input_ = type_ == Type::f32 ? pooled_ : MakeBuffer(BlockLayout(stem.outputs));
  }

  void AddBlock(const BasicBlock& layers) {
    const memory input = blocks_.empty() ? input_ : blocks_.back().result;
    h_ = Strided(h_, layers.conv1.stride);
    w_ = Strided(w_, layers.conv1.stride);
    BlockPrimitives& block = blocks_.emplace_back();
    block.conv1.emplace(layers.conv1, input.get_desc(), BlockLayout(layers.conv1.outputs),
                        SamePadding(layers.conv1, true, false));
    const memory::desc hidden = block.conv1->destination_desc();
    // In the stem's buffer, which is free after the pooling; only for tiny images it is too small.
    block.hidden = hidden.get_size() <= stem_result_.get_desc().get_size()
                       ? memory(hidden, CpuEngine(), stem_result_.get_data_handle())
                       : MakeBuffer(hidden);
    block.result = input;  // identity shortcut: in place
    if (layers.downsample) {
      block.downsample.emplace(*layers.downsample, input.get_desc(),
                               BlockLayout(layers.downsample->outputs),
                               SamePadding(*layers.downsample, false, false));
      Reserve(*block.downsample);
      block.result = MakeBuffer(block.downsample->destination_desc());
    }
    block.conv2.emplace(layers.conv2, block.conv1->destination_desc(), block.result.get_desc(),
                        SamePadding(layers.conv2, true, true));
    Reserve(*block.conv1);
    Reserve(*block.conv2);
  }

  // Of a block's map. For bf16 oneDNN would choose layouts that it has no products of tiles for.
  memory::desc BlockLayout(int channels) const {
    return DenseDesc({1, channels, h_, w_}, type_ == Type::f32 ? Tag::any : Tag::nhwc, type_);
  }

  memory MakeBuffer(const memory::desc& desc) {
    buffer_bytes_ += desc.get_size();
    return {desc, CpuEngine()};
  }

  void Reserve(const ConvPrimitive& primitive) {
    scratch_bytes_ = std::max(scratch_bytes_, primitive.scratch_bytes());
  }

  FeatureMap ChannelsLast(const memory& blocked) {
    FeatureMap map = {h_, w_, channels_, height_, width_, {}};
    map.values.resize(static_cast<std::size_t>(h_ * w_) * static_cast<std::size_t>(channels_));
    memory from = blocked;
    memory to(DenseDesc({1, channels_, h_, w_}, Tag::nhwc), CpuEngine(), map.values.data());
    dnnl::reorder(from, to).execute(stream_, from, to);
    stream_.wait();
    return map;
  }

  const memory::data_type type_;
  const int height_;
  const int width_;
  const int threads_;
  const int channels_;
  int h_ = 0;  // extent of the layer added last
  int w_ = 0;
  dnnl::stream stream_;
  std::size_t scratch_bytes_ = 0;
  std::size_t buffer_bytes_ = 0;
  AlignedFloats scratch_;
  std::optional<ConvPrimitive> stem_;
  memory stem_result_;
  dnnl::pooling_forward pool_;
  memory::desc pool_scratch_;
  memory pooled_;
  memory input_;  // of the blocks: pooled_ as type_
  std::vector<BlockPrimitives> blocks_;
};

std::vector<float> UnitPolarGrid(RadialSpacing spacing) {
  const std::vector<Point> grid = Grid(spacing);
  std::vector<float> planar(2 * kPatchPixels);
  for (std::size_t q = 0; q < kPatchPixels; ++q) {
    planar[q] = static_cast<float>(grid[q][0]);
    planar[kPatchPixels + q] = static_cast<float>(grid[q][1]);
  }
  return planar;
}

std::vector<float> TpsBasis(RadialSpacing spacing) {
  const std::vector<Point> linear = InBox(Grid(RadialSpacing::kLinear));
  std::vector<Point> controls;
  for (int i = 0; i < kPatchSide; i += kControlStride) {
    for (int j = 0; j < kPatchSide; j += kControlStride) {
      controls.push_back(linear[static_cast<std::size_t>(i * kPatchSide + j)]);
    }
  }
  std::vector<float> basis;
  basis.reserve(static_cast<std::size_t>(kPatchPixels) * kTpsParameters);
  for (const Point& q : InBox(Grid(spacing))) {
    const double first = Rho(q, controls[0]);
    for (std::size_t k = 1; k < controls.size(); ++k) {
      basis.push_back(static_cast<float>(Rho(q, controls[k]) - first));
    }
    basis.insert(basis.end(), {1.0F, static_cast<float>(q[0]), static_cast<float>(q[1])});
  }
  return basis;
}

double DisplacementGain() { return 2 * HalfWidth() / kBoxScale; }

Backbone::Backbone(std::shared_ptr<const DealWeights> weights, Type type)
    : weights_(std::move(weights)),
      type_(type),
      pool_(kIdleBytes, [](const SizedBackbone& network) { return network.bytes(); }) {
  dnnl::set_primitive_cache_capacity(kKeptPrimitives);
}

Backbone::~Backbone() = default;

FeatureMap Backbone::Run(const GreyImage& image, int threads) const {
  const ScopedPrimitiveThreads scope(threads);
  const auto network = pool_.Take(
      [&](const SizedBackbone& idle) { return idle.Fits(image.height, image.width, threads); },
      [&] {
        return std::make_unique<SizedBackbone>(*weights_, type_, image.height, image.width,
                                               threads);
      });
  return network->Run(image);
}

LocalizationNet::LocalizationNet(const DealWeights& weights, Type type) : type_(type) {
  const ScopedPrimitiveThreads one(1);
  for (std::size_t i = 0; i < kLayers; ++i) {
    const LinearLayer& layer = weights.localization[i];
    const Activation after = i + 1 < kLayers ? Activation::kRelu : Activation::kTanh;
    large_.emplace_back(ProductPrimitive::Shape{0, static_cast<int>(kLargeBatch), layer.inputs,
                                                layer.outputs, LayerType(i), LayerType(i + 1)},
                        layer.weight, /*transposed=*/true, layer.bias, after);
    small_.emplace_back(large_.back(), static_cast<int>(kSmallBatch));
  }
}

// The last layer's weights, which end in the inverse of the spline's matrix, cancel each other out.
dnnl::memory::data_type LocalizationNet::LayerType(std::size_t layer) const {
  return layer + 1 < kLayers ? type_ : Type::f32;
}

std::unique_ptr<LocalizationNet::Worker> LocalizationNet::MakeWorker() const {
  auto worker = std::make_unique<Worker>();
  std::size_t scratch = 0;
  for (std::size_t i = 0; i < kLayers; ++i) {
    const auto inner = static_cast<std::size_t>(large_[i].shape().inner);
    worker->values[i] = AlignedFloats(kLargeBatch * inner);
    scratch = std::max({scratch, large_[i].scratch_bytes(), small_[i].scratch_bytes()});
  }
  worker->values[kLayers] = AlignedFloats(kLargeBatch * kThetaValues);
  worker->scratch = AlignedFloats(scratch / sizeof(float) + 1);
  return worker;
}

namespace {

template <typename Value>
void SampleMap(const FeatureMap& map, std::span<const Keypoint> keypoints,
               void (*sample)(const float*, int, int, int, float, float, Value*), Value* samples) {
  // Keypoint to cell: the corner pixels' centres lie on the corner cells.
  const auto scale = [](int cells, int pixels) {
    return pixels > 1 ? static_cast<float>(cells - 1) / static_cast<float>(pixels - 1) : 0.0F;
  };
  const float x_scale = scale(map.width, map.image_width);
  const float y_scale = scale(map.height, map.image_height);
  for (const Keypoint& point : keypoints) {
    sample(map.values.data(), map.height, map.width, map.channels, point.x * x_scale,
           point.y * y_scale, samples);
    samples += kNeighbours * kNeighbours * map.channels;
  }
}

}  // namespace

void LocalizationNet::Sample(const FeatureMap& map, std::span<const Keypoint> keypoints,
                             float* samples) {
  SampleMap(map, keypoints, BestKernels().sample_features, samples);
}

std::vector<float> LocalizationNet::Theta(const FeatureMap& map,
                                          std::span<const Keypoint> keypoints, int threads) const {
  const std::size_t count = keypoints.size();
  std::vector<float> theta(count * kThetaValues);
  // A remainder below half of the large batch goes through the small one.
  const std::size_t whole = (count + kLargeBatch / 2) / kLargeBatch;
  const std::size_t rest_from = std::min(count, whole * kLargeBatch);
  const std::size_t items = whole + (count - rest_from + kSmallBatch - 1) / kSmallBatch;
  ParallelFor(items, threads, [&](std::size_t i) {
    const ScopedPrimitiveThreads one(1);
    const auto worker =
        pool_.Take([](const Worker&) { return true; }, [&] { return MakeWorker(); });
    const std::size_t first = i < whole ? i * kLargeBatch : rest_from + (i - whole) * kSmallBatch;
    const std::size_t batch = std::min(i < whole ? kLargeBatch : kSmallBatch, count - first);
    const std::span<const Keypoint> points = keypoints.subspan(first, batch);
    float* const samples = worker->values[0].data();
    if (type_ == Type::f32) {
      Sample(map, points, samples);
    } else {
      SampleMap(map, points, BestKernels().sample_features_bfloat16,
                reinterpret_cast<std::uint16_t*>(samples));
    }
    const std::vector<ProductPrimitive>& mlp = batch > kSmallBatch ? large_ : small_;
    for (std::size_t layer = 0; layer < kLayers; ++layer) {
      mlp[layer].Run(worker->stream, worker->values[layer].data(), worker->values[layer + 1].data(),
                     worker->scratch.data());
    }
    worker->stream.wait();
    std::memcpy(theta.data() + first * kThetaValues, worker->values[kLayers].data(),
                batch * kThetaValues * sizeof(float));
  });
  return theta;
}

DealNetwork::Worker::Worker(const DealNetwork& network)
    : hardnet(network.hardnet_),
      parameters(kBatch * kThetaValues),
      shifts(kBatch * kShiftValues),
      scratch(network.warp_.scratch_bytes() / sizeof(float) + 1) {}

DealNetwork::DealNetwork(DealWeights weights, Type type)
    : weights_(std::make_shared<const DealWeights>(std::move(weights))),
      backbone_(weights_, type),
      localization_(*weights_, type),
      hardnet_(*weights_, type),
      warp_(WarpProduct(weights_->radial_spacing)),
      grid_(UnitPolarGrid(weights_->radial_spacing)) {}

Pool<DealNetwork::Worker>::Lease DealNetwork::TakeWorker() const {
  return pool_.Take([](const Worker&) { return true; },
                    [&] { return std::make_unique<Worker>(*this); });
}

GreyImage DealNetwork::ToImage(const Image& grey) {
  const std::int64_t pixels = std::int64_t{grey.width} * grey.height;
  if (grey.channels != 1 || grey.width < 1 || grey.height < 1 ||
      grey.pixels.size() != static_cast<std::size_t>(pixels)) {
    throw Error(ErrorCode::kInvalidArgument, "image_not_grey",
                "DEAL describes grey images with one byte per pixel; decode with colour = false");
  }
  if (pixels > kMaxPixels) {
    throw Error(ErrorCode::kTooLarge, "image_too_large",
                "an image of " + std::to_string(grey.width) + " x " + std::to_string(grey.height) +
                    " pixels is too large to describe (limit " + std::to_string(kMaxPixels) +
                    " pixels); scale it down with max_side_px");
  }
  GreyImage image = {grey.height, grey.width, {}};
  image.values.resize(grey.pixels.size());
  std::transform(grey.pixels.begin(), grey.pixels.end(), image.values.begin(),
                 [](std::uint8_t value) { return static_cast<float>(value) / 255.0F; });
  return image;
}

std::vector<float> DealNetwork::Displacements(std::span<const float> theta, int threads) const {
  const std::size_t count = theta.size() / kThetaValues;
  std::vector<float> shifts(count * kShiftValues);
  ForEach(kBatch, count, threads, [&](std::size_t first, std::size_t batch) {
    const auto worker = TakeWorker();
    for (std::size_t i = 0; i < batch; ++i) {
      const float* from = theta.data() + (first + i) * kThetaValues;
      float* to = worker->parameters.data() + i * kThetaValues;
      for (std::size_t k = 0; k < kTpsParameters; ++k) {
        to[k] = from[2 * k];
        to[kTpsParameters + k] = from[2 * k + 1];
      }
    }
    warp_.Run(worker->stream, worker->parameters.data(), worker->shifts.data(),
              worker->scratch.data());
    worker->stream.wait();
    std::memcpy(shifts.data() + first * kShiftValues, worker->shifts.data(),
                batch * kShiftValues * sizeof(float));
  });
  return shifts;
}

std::vector<float> DealNetwork::Patches(const GreyImage& image, std::span<const Keypoint> keypoints,
                                        std::span<const float> shifts, float support,
                                        int threads) const {
  std::vector<float> patches(keypoints.size() * kPatchPixels);
  const float radius = support * static_cast<float>(weights_->radius_per_size);
  ForEach(kBatch, keypoints.size(), threads, [&](std::size_t first, std::size_t batch) {
    for (std::size_t i = first; i < first + batch; ++i) {
      const Keypoint& point = keypoints[i];
      BestKernels().sample_patch(image.values.data(), image.height, image.width, point.x, point.y,
                                 radius * point.size, grid_.data(),
                                 shifts.empty() ? nullptr : shifts.data() + i * kShiftValues,
                                 patches.data() + i * kPatchPixels);
    }
  });
  return patches;
}

std::vector<float> DealNetwork::DescribePatches(std::span<const float> patches, int threads) const {
  const std::size_t count = patches.size() / kPatchPixels;
  std::vector<float> rows(count * dim());
  ForEach(kBatch, count, threads, [&](std::size_t first, std::size_t batch) {
    TakeWorker()->hardnet.Run(patches.data() + first * kPatchPixels, batch,
                              rows.data() + first * dim());
  });
  return rows;
}

std::vector<float> DealNetwork::Describe(const Image& grey, std::span<const Keypoint> keypoints,
                                         bool warp, std::span<const float> supports, int threads,
                                         std::span<const EnlargedKeypoints> finer) const {
  std::vector<Keypoint> all(keypoints.begin(), keypoints.end());
  for (const EnlargedKeypoints& more : finer) {
    CheckKeypoints(more.inside);
    all.insert(all.end(), more.placed.begin(), more.placed.end());
  }
  CheckKeypoints(all);
  const GreyImage image = ToImage(grey);
  if (all.empty()) return {};
  std::vector<float> theta;
  if (warp) theta = localization_.Theta(backbone_.Run(image, threads), all, threads);
  std::vector<float> rows(all.size() * dim());
  std::size_t done = 0;
  const auto describe = [&](const Image& from, std::span<const Keypoint> points) {
    if (points.empty()) return;
    const std::size_t values = warp ? kThetaValues : 0;
    DescribeWarped(from, points, std::span(theta).subspan(done * values, points.size() * values),
                   supports, threads, rows.data() + done * dim());
    done += points.size();
  };
  describe(grey, keypoints);
  for (const EnlargedKeypoints& more : finer) describe(more.image, more.inside);
  return rows;
}

void DealNetwork::DescribeWarped(const Image& grey, std::span<const Keypoint> keypoints,
                                 std::span<const float> theta, std::span<const float> supports,
                                 int threads, float* rows) const {
  const GreyImage image = ToImage(grey);
  // A few batches pass the stages in one thread: their buffers stay small, and a stage's weights
  // stay in the cache for some time. There are several such steps a thread.
  const std::size_t share = keypoints.size() / (4 * static_cast<std::size_t>(threads));
  const std::size_t step = kBatch * std::clamp<std::size_t>(share / kBatch, 1, 8);
  ForEach(step, keypoints.size(), threads, [&](std::size_t first, std::size_t count) {
    const std::span<const Keypoint> points = keypoints.subspan(first, count);
    std::vector<float> shifts;
    if (!theta.empty()) {
      shifts = Displacements(theta.subspan(first * kThetaValues, count * kThetaValues), 1);
    }
    float* const to = rows + first * dim();
    for (const float support : supports) {
      const std::vector<float> more =
          DescribePatches(Patches(image, points, shifts, support, 1), 1);
      std::transform(more.begin(), more.end(), to, to, std::plus<>());
    }
  });
  if (supports.size() == 1) return;  // of unit length already
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    NormalizeLength({rows + i * dim(), dim()});
  }
}

}  // namespace pliant::deal
