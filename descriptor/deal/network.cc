// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/network.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/deal/kernels.h"
#include "descriptor/deal/pool.h"
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

// Buffers that are kept between calls. A network of its size is made for every size of image.
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

// Everything for one image size and thread count, run by one caller at a time.
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

  FeatureMap Run(const GreyImage& image) {
    const memory source(stem_->source_desc(), CpuEngine(), const_cast<float*>(image.values.data()));
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

constexpr std::size_t kLayers = 4;
constexpr std::size_t kIdleWorkers = 64;
// Keypoints a product. The first layer's 6.5 MB of weights are read once a batch, so the large
// batch is large; the small one serves images with few keypoints and the remainder.
constexpr std::size_t kLargeBatch = 128;
constexpr std::size_t kSmallBatch = 16;

using Mlp = std::vector<ProductPrimitive>;  // kLayers of them, for one batch size

// Keypoint to cell: the corner pixels' centres lie on the corner cells.
float CellScale(int cells, int pixels) {
  return pixels > 1 ? static_cast<float>(cells - 1) / static_cast<float>(pixels - 1) : 0.0F;
}

void SampleOne(const FeatureMap& map, const Keypoint& keypoint, float* out) {
  BestKernels().sample_features(map.values.data(), map.height, map.width,
                                keypoint.x * CellScale(map.width, map.image_width),
                                keypoint.y * CellScale(map.height, map.image_height), out);
}

constexpr std::size_t kBatch = HardNet::kBatch;
constexpr std::size_t kShiftValues = 2 * kPatchPixels;  // x values, then y values

// kTpsParameters x kPatchPixels: the basis transposed, in units of R.
std::vector<float> ScaledBasis(RadialSpacing spacing) {
  const std::vector<float> basis = TpsBasis(spacing);
  const double gain = DisplacementGain();
  std::vector<float> scaled(basis.size());
  for (std::size_t q = 0; q < kPatchPixels; ++q) {
    for (std::size_t k = 0; k < kTpsParameters; ++k) {
      scaled[k * kPatchPixels + q] = static_cast<float>(gain * basis[q * kTpsParameters + k]);
    }
  }
  return scaled;
}

std::vector<float> PlanarGrid(RadialSpacing spacing) {
  const std::vector<float> grid = UnitPolarGrid(spacing);
  std::vector<float> planar(grid.size());
  for (std::size_t q = 0; q < kPatchPixels; ++q) {
    planar[q] = grid[2 * q];
    planar[kPatchPixels + q] = grid[2 * q + 1];
  }
  return planar;
}

void Add(const float* values, std::size_t count, float* into) {
  for (std::size_t i = 0; i < count; ++i) into[i] += values[i];
}

ProductPrimitive WarpProduct(RadialSpacing spacing) {
  const ScopedPrimitiveThreads one(1);
  return {{0, static_cast<int>(2 * kBatch), kTpsParameters, kPatchPixels},
          ScaledBasis(spacing),
          /*transposed=*/false,
          {},
          Activation::kNone};
}

}  // namespace

std::vector<float> UnitPolarGrid(RadialSpacing spacing) {
  std::vector<float> values;
  values.reserve(2 * kPatchPixels);
  for (const Point& point : Grid(spacing)) {
    values.push_back(static_cast<float>(point[0]));
    values.push_back(static_cast<float>(point[1]));
  }
  return values;
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

struct Backbone::Impl {
  explicit Impl(std::shared_ptr<const DealWeights> w) : weights(std::move(w)) {}

  std::shared_ptr<const DealWeights> weights;
  Pool<SizedBackbone> pool{kIdleBytes,
                           [](const SizedBackbone& network) { return network.bytes(); }};
};

Backbone::Backbone(std::shared_ptr<const DealWeights> weights)
    : impl_(std::make_unique<Impl>(std::move(weights))) {}

Backbone::~Backbone() = default;

FeatureMap Backbone::Run(const GreyImage& image, int threads) const {
  const ScopedPrimitiveThreads scope(threads);
  const auto network = impl_->pool.Take(
      [&](const SizedBackbone& idle) { return idle.Fits(image.height, image.width, threads); },
      [&] {
        return std::make_unique<SizedBackbone>(*impl_->weights, image.height, image.width, threads);
      });
  return network->Run(image);
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

struct LocalizationNet::Impl {
  // Buffers of one thread: the input of each layer and the last one's result.
  struct Worker {
    std::array<AlignedFloats, kLayers + 1> values;
    AlignedFloats scratch;
    dnnl::stream stream{CpuEngine()};
  };

  explicit Impl(const DealWeights& weights) {
    const ScopedPrimitiveThreads one(1);
    for (std::size_t i = 0; i < kLayers; ++i) {
      const LinearLayer& layer = weights.localization[i];
      const Activation after = i + 1 < kLayers ? Activation::kRelu : Activation::kTanh;
      large.emplace_back(
          ProductPrimitive::Shape{0, static_cast<int>(kLargeBatch), layer.inputs, layer.outputs},
          layer.weight, /*transposed=*/true, layer.bias, after);
      small.emplace_back(large.back(), static_cast<int>(kSmallBatch));
    }
  }

  std::unique_ptr<Worker> MakeWorker() const {
    auto worker = std::make_unique<Worker>();
    std::size_t scratch = 0;
    for (std::size_t i = 0; i < kLayers; ++i) {
      const auto inner = static_cast<std::size_t>(large[i].shape().inner);
      worker->values[i] = AlignedFloats(kLargeBatch * inner);
      scratch = std::max({scratch, large[i].scratch_bytes(), small[i].scratch_bytes()});
    }
    worker->values[kLayers] = AlignedFloats(kLargeBatch * kThetaValues);
    worker->scratch = AlignedFloats(scratch / sizeof(float) + 1);
    return worker;
  }

  // Fills values[0] by fill(first, count, destination) and writes `count` rows of theta.
  template <typename Fill>
  void RunBatch(Worker& worker, std::size_t first, std::size_t count, const Fill& fill,
                float* theta) const {
    fill(first, count, worker.values[0].data());
    const Mlp& mlp = count > kSmallBatch ? large : small;
    for (std::size_t i = 0; i < kLayers; ++i) {
      mlp[i].Run(worker.stream, worker.values[i].data(), worker.values[i + 1].data(),
                 worker.scratch.data());
    }
    worker.stream.wait();
    std::memcpy(theta + first * kThetaValues, worker.values[kLayers].data(),
                count * kThetaValues * sizeof(float));
  }

  template <typename Fill>
  std::vector<float> Run(std::size_t count, int threads, const Fill& fill) {
    std::vector<float> theta(count * kThetaValues);
    // A remainder below half of the large batch goes through the small one.
    const std::size_t whole = (count + kLargeBatch / 2) / kLargeBatch;
    const std::size_t rest_from = std::min(count, whole * kLargeBatch);
    const std::size_t items = whole + (count - rest_from + kSmallBatch - 1) / kSmallBatch;
    ParallelFor(items, threads, [&](std::size_t i) {
      const ScopedPrimitiveThreads one(1);
      const auto worker =
          pool.Take([](const Worker&) { return true; }, [&] { return MakeWorker(); });
      const std::size_t first = i < whole ? i * kLargeBatch : rest_from + (i - whole) * kSmallBatch;
      const std::size_t batch = i < whole ? kLargeBatch : kSmallBatch;
      RunBatch(*worker, first, std::min(batch, count - first), fill, theta.data());
    });
    return theta;
  }

  Mlp large;
  Mlp small;
  Pool<Worker> pool{kIdleWorkers};
};

LocalizationNet::LocalizationNet(const DealWeights& weights)
    : impl_(std::make_unique<Impl>(weights)) {}

LocalizationNet::~LocalizationNet() = default;

std::vector<float> LocalizationNet::Sample(const FeatureMap& map,
                                           std::span<const Keypoint> keypoints, int threads) const {
  std::vector<float> samples(keypoints.size() * kSampledValues);
  constexpr std::size_t kStep = 64;
  ParallelFor((keypoints.size() + kStep - 1) / kStep, threads, [&](std::size_t step) {
    const std::size_t end = std::min(keypoints.size(), (step + 1) * kStep);
    for (std::size_t i = step * kStep; i < end; ++i) {
      SampleOne(map, keypoints[i], samples.data() + i * kSampledValues);
    }
  });
  return samples;
}

std::vector<float> LocalizationNet::Theta(const FeatureMap& map,
                                          std::span<const Keypoint> keypoints, int threads) const {
  return impl_->Run(keypoints.size(), threads,
                    [&](std::size_t first, std::size_t count, float* rows) {
                      for (std::size_t i = 0; i < count; ++i) {
                        SampleOne(map, keypoints[first + i], rows + i * kSampledValues);
                      }
                    });
}

std::vector<float> LocalizationNet::ThetaFromSamples(std::span<const float> samples,
                                                     int threads) const {
  return impl_->Run(samples.size() / kSampledValues, threads,
                    [&](std::size_t first, std::size_t count, float* rows) {
                      std::memcpy(rows, samples.data() + first * kSampledValues,
                                  count * kSampledValues * sizeof(float));
                    });
}

double LocalizationNet::multiply_adds() const {
  double sum = 0;
  for (const ProductPrimitive& layer : impl_->large) {
    sum += static_cast<double>(layer.shape().inner) * layer.shape().columns;
  }
  return sum;
}

struct DealNetwork::Impl {
  explicit Impl(RadialSpacing spacing) : warp(WarpProduct(spacing)), grid(PlanarGrid(spacing)) {}

  // Buffers of one thread, for batches of keypoints.
  struct Worker {
    explicit Worker(const Impl& impl, const HardNet& net)
        : hardnet(net), scratch(impl.warp.scratch_bytes() / sizeof(float) + 1) {}

    HardNet::Worker hardnet;
    dnnl::stream stream{CpuEngine()};
    AlignedFloats parameters{kBatch * kThetaValues};
    AlignedFloats shifts{kBatch * kShiftValues};
    AlignedFloats patches{kBatch * kPatchPixels};
    AlignedFloats further{kBatch * kDescriptorDim};
    AlignedFloats scratch;
  };

  // worker.shifts from `count` rows of theta.
  void Warp(Worker& worker, const float* theta, std::size_t count) const {
    for (std::size_t i = 0; i < count; ++i) {
      const float* from = theta + i * kThetaValues;
      float* to = worker.parameters.data() + i * kThetaValues;
      for (std::size_t k = 0; k < kTpsParameters; ++k) {
        to[k] = from[2 * k];
        to[kTpsParameters + k] = from[2 * k + 1];
      }
    }
    warp.Run(worker.stream, worker.parameters.data(), worker.shifts.data(), worker.scratch.data());
    worker.stream.wait();
  }

  // `count` patches; shifts null = the fixed grid.
  void Sample(const GreyImage& image, const Keypoint* keypoints, const float* shifts,
              std::size_t count, float radius_per_size, float* patches) const {
    for (std::size_t i = 0; i < count; ++i) {
      const Keypoint& point = keypoints[i];
      BestKernels().sample_patch(image.values.data(), image.height, image.width, point.x, point.y,
                                 radius_per_size * point.size, grid.data(),
                                 shifts != nullptr ? shifts + i * kShiftValues : nullptr,
                                 patches + i * kPatchPixels);
    }
  }

  // body(worker, first, count) for each batch.
  template <typename Body>
  void ForBatches(const HardNet& net, std::size_t total, int threads, const Body& body) {
    const std::size_t batches = (total + kBatch - 1) / kBatch;
    ParallelFor(batches, threads, [&](std::size_t i) {
      const ScopedPrimitiveThreads one(1);
      const auto worker = pool.Take([](const Worker&) { return true; },
                                    [&] { return std::make_unique<Worker>(*this, net); });
      body(*worker, i * kBatch, std::min(kBatch, total - i * kBatch));
    });
  }

  ProductPrimitive warp;
  std::vector<float> grid;
  Pool<Worker> pool{kIdleWorkers};
};

DealNetwork::DealNetwork(DealWeights weights)
    : weights_(std::make_shared<const DealWeights>(std::move(weights))),
      backbone_(weights_),
      localization_(*weights_),
      hardnet_(*weights_),
      impl_(std::make_unique<Impl>(weights_->radial_spacing)) {}

DealNetwork::~DealNetwork() = default;

GreyImage DealNetwork::ToImage(const Image& grey) {
  const std::int64_t pixels = std::int64_t{grey.width} * grey.height;
  if (grey.channels != 1 || grey.width < 1 || grey.height < 1 ||
      grey.pixels.size() != static_cast<std::size_t>(pixels)) {
    throw Error(ErrorCode::kInvalidArgument, "image_not_grey",
                "DEAL describes grey images with one byte a pixel; decode with colour = false");
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

void DealNetwork::CheckKeypoints(std::span<const Keypoint> keypoints) {
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

std::vector<float> DealNetwork::Displacements(std::span<const float> theta, int threads) const {
  const std::size_t count = theta.size() / kThetaValues;
  std::vector<float> shifts(count * kShiftValues);
  impl_->ForBatches(hardnet_, count, threads,
                    [&](Impl::Worker& worker, std::size_t first, std::size_t batch) {
                      impl_->Warp(worker, theta.data() + first * kThetaValues, batch);
                      std::memcpy(shifts.data() + first * kShiftValues, worker.shifts.data(),
                                  batch * kShiftValues * sizeof(float));
                    });
  return shifts;
}

std::vector<float> DealNetwork::Patches(const GreyImage& image, std::span<const Keypoint> keypoints,
                                        std::span<const float> theta, int threads) const {
  std::vector<float> patches(keypoints.size() * kPatchPixels);
  const auto radius = static_cast<float>(weights_->radius_per_size);
  impl_->ForBatches(hardnet_, keypoints.size(), threads,
                    [&](Impl::Worker& worker, std::size_t first, std::size_t batch) {
                      const bool warp = !theta.empty();
                      if (warp) impl_->Warp(worker, theta.data() + first * kThetaValues, batch);
                      impl_->Sample(image, keypoints.data() + first,
                                    warp ? worker.shifts.data() : nullptr, batch, radius,
                                    patches.data() + first * kPatchPixels);
                    });
  return patches;
}

std::vector<float> DealNetwork::DescribePatches(std::span<const float> patches, int threads) const {
  const std::size_t count = patches.size() / kPatchPixels;
  std::vector<float> rows(count * kDescriptorDim);
  impl_->ForBatches(hardnet_, count, threads,
                    [&](Impl::Worker& worker, std::size_t first, std::size_t batch) {
                      worker.hardnet.Run(patches.data() + first * kPatchPixels, batch,
                                         rows.data() + first * kDescriptorDim);
                    });
  return rows;
}

std::vector<float> DealNetwork::Describe(const Image& grey, std::span<const Keypoint> keypoints,
                                         bool warp, std::span<const float> supports,
                                         int threads) const {
  const GreyImage image = ToImage(grey);
  CheckKeypoints(keypoints);
  std::vector<float> rows(keypoints.size() * kDescriptorDim);
  if (keypoints.empty()) return rows;
  std::vector<float> theta;
  if (warp) {
    theta = localization_.Theta(backbone_.Run(image, threads), keypoints, threads);
  }
  const auto radius = static_cast<float>(weights_->radius_per_size);
  impl_->ForBatches(hardnet_, keypoints.size(), threads,
                    [&](Impl::Worker& worker, std::size_t first, std::size_t batch) {
                      if (warp) impl_->Warp(worker, theta.data() + first * kThetaValues, batch);
                      const float* shifts = warp ? worker.shifts.data() : nullptr;
                      const auto describe = [&](float support, float* into) {
                        impl_->Sample(image, keypoints.data() + first, shifts, batch,
                                      support * radius, worker.patches.data());
                        worker.hardnet.Run(worker.patches.data(), batch, into);
                      };
                      float* into = rows.data() + first * kDescriptorDim;
                      describe(supports.front(), into);
                      for (const float support : supports.subspan(1)) {
                        describe(support, worker.further.data());
                        Add(worker.further.data(), batch * kDescriptorDim, into);
                      }
                      if (supports.size() == 1) return;  // of unit length already
                      for (std::size_t i = 0; i < batch; ++i)
                        NormalizeLength(into + i * kDescriptorDim);
                    });
  return rows;
}

}  // namespace pliant::deal
