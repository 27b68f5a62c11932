// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/localization.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "descriptor/base/parallel.h"
#include "descriptor/deal/kernels.h"
#include "descriptor/deal/pool.h"
#include "descriptor/deal/primitives.h"

namespace pliant::deal {
namespace {

constexpr std::size_t kLayers = 4;
constexpr std::size_t kIdleWorkers = 64;
// Key points a product. The first layer's 6.5 MB of weights are read once a batch, so the large
// batch is large; the small one serves pictures with few key points and the remainder.
constexpr std::size_t kLargeBatch = 128;
constexpr std::size_t kSmallBatch = 16;

using Mlp = std::vector<ProductPrimitive>;  // kLayers of them, for one batch size

}  // namespace

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

namespace {

// Key point to cell: the corner pixels' centres lie on the corner cells.
float CellScale(int cells, int pixels) {
  return pixels > 1 ? static_cast<float>(cells - 1) / static_cast<float>(pixels - 1) : 0.0F;
}

void SampleOne(const FeatureMap& map, const Keypoint& keypoint, float* out) {
  BestKernels().sample_features(map.values.data(), map.height, map.width,
                                keypoint.x * CellScale(map.width, map.picture_width),
                                keypoint.y * CellScale(map.height, map.picture_height), out);
}

}  // namespace

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

}  // namespace pliant::deal
