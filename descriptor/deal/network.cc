// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/network.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/deal/geometry.h"
#include "descriptor/deal/kernels.h"
#include "descriptor/deal/pool.h"
#include "descriptor/deal/primitives.h"

namespace pliant::deal {
namespace {

constexpr std::size_t kBatch = HardNet::kBatch;
constexpr std::size_t kIdleWorkers = 64;
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

struct DealNetwork::Impl {
  explicit Impl(RadialSpacing spacing) : warp(WarpProduct(spacing)), grid(PlanarGrid(spacing)) {}

  // Buffers of one thread, for batches of key points.
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
  void Sample(const GreyPicture& picture, const Keypoint* keypoints, const float* shifts,
              std::size_t count, float radius_per_size, float* patches) const {
    for (std::size_t i = 0; i < count; ++i) {
      const Keypoint& point = keypoints[i];
      BestKernels().sample_patch(picture.values.data(), picture.height, picture.width, point.x,
                                 point.y, radius_per_size * point.size, grid.data(),
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

GreyPicture DealNetwork::ToPicture(const Image& grey) {
  const std::int64_t pixels = std::int64_t{grey.width} * grey.height;
  if (grey.channels != 1 || grey.width < 1 || grey.height < 1 ||
      grey.pixels.size() != static_cast<std::size_t>(pixels)) {
    throw Error(ErrorCode::kInvalidArgument, "image_not_grey",
                "DEAL describes grey pictures with one byte a pixel; decode with colour = false");
  }
  if (pixels > kMaxPixels) {
    throw Error(ErrorCode::kTooLarge, "image_too_large",
                "a picture of " + std::to_string(grey.width) + " x " + std::to_string(grey.height) +
                    " pixels is too large to describe (limit " + std::to_string(kMaxPixels) +
                    " pixels); scale it down with max_side_px");
  }
  GreyPicture picture = {grey.height, grey.width, {}};
  picture.values.resize(grey.pixels.size());
  std::transform(grey.pixels.begin(), grey.pixels.end(), picture.values.begin(),
                 [](std::uint8_t value) { return static_cast<float>(value) / 255.0F; });
  return picture;
}

void DealNetwork::CheckKeypoints(std::span<const Keypoint> keypoints) {
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const Keypoint& point = keypoints[i];
    if (!std::isfinite(point.x) || !std::isfinite(point.y) || !std::isfinite(point.size) ||
        !(point.size > 0)) {
      throw Error(
          ErrorCode::kInvalidArgument, "keypoint_invalid",
          "key point " + std::to_string(i) + " needs a finite place and a finite size above 0");
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

std::vector<float> DealNetwork::Patches(const GreyPicture& picture,
                                        std::span<const Keypoint> keypoints,
                                        std::span<const float> theta, int threads) const {
  std::vector<float> patches(keypoints.size() * kPatchPixels);
  const auto radius = static_cast<float>(weights_->radius_per_size);
  impl_->ForBatches(hardnet_, keypoints.size(), threads,
                    [&](Impl::Worker& worker, std::size_t first, std::size_t batch) {
                      const bool warp = !theta.empty();
                      if (warp) impl_->Warp(worker, theta.data() + first * kThetaValues, batch);
                      impl_->Sample(picture, keypoints.data() + first,
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
  const GreyPicture picture = ToPicture(grey);
  CheckKeypoints(keypoints);
  std::vector<float> rows(keypoints.size() * kDescriptorDim);
  if (keypoints.empty()) return rows;
  std::vector<float> theta;
  if (warp) {
    theta = localization_.Theta(backbone_.Run(picture, threads), keypoints, threads);
  }
  const auto radius = static_cast<float>(weights_->radius_per_size);
  impl_->ForBatches(hardnet_, keypoints.size(), threads,
                    [&](Impl::Worker& worker, std::size_t first, std::size_t batch) {
                      if (warp) impl_->Warp(worker, theta.data() + first * kThetaValues, batch);
                      const float* shifts = warp ? worker.shifts.data() : nullptr;
                      const auto describe = [&](float support, float* into) {
                        impl_->Sample(picture, keypoints.data() + first, shifts, batch,
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
