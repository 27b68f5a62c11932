// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// HardNet's convolutions, all layers but its linear head: patches to the mean over rows (the angle)
// of the last map. Everything is channels-last. Internal to deal/.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "descriptor/deal/kernels.h"
#include "descriptor/deal/primitives.h"
#include "descriptor/deal/weights.h"

namespace pliant::deal {

// Immutable and thread-safe; workers hold the mutable state.
class HardNetBody {
 public:
  static constexpr std::size_t kBatch = 16;  // maximum number of patches per Worker::Run

  // Scratch memory for one thread at a time. The body must outlive it.
  class Worker {
   public:
    virtual ~Worker() = default;
    // Patches count x 32 x 32 (rows = angle) to count x columns x channels; count <= kBatch.
    // oneDNN must be set to one thread (ScopedPrimitiveThreads).
    virtual void Run(const float* patches, std::size_t count, float* pooled) = 0;
  };

  virtual ~HardNetBody() = default;
  virtual std::unique_ptr<Worker> MakeWorker() const = 0;
};

// The stride-1 layers in float32 by Winograd's F(4x4, 3x3), which needs 2.25 to 4 times fewer
// products than a direct convolution.
std::unique_ptr<HardNetBody> MakeWinogradBody(const DealWeights& weights);

// Direct convolutions of maps and weights in bfloat16, with sums in float32. Winograd's transforms
// would lose too many of its 8 bits.
std::unique_ptr<HardNetBody> MakeDirectBody(const DealWeights& weights);

// The first layer, which one of Kernels computes: weight 9 x channels.
struct FirstLayer {
  explicit FirstLayer(const ConvLayer& layer);

  int channels, stride;
  std::vector<float> weight, bias;
};

// Winograd's weights G g G^T (Lavin and Gray 2016, section 4.3): kTilePlanes matrices of inputs x
// outputs.
std::vector<float> WinogradWeights(const ConvLayer& layer);

// Values of a side x side x channels map, or of side x channels with rows = 1.
inline std::size_t MapSize(int rows, int side, int channels) {
  return static_cast<std::size_t>(rows) * static_cast<std::size_t>(side) *
         static_cast<std::size_t>(channels);
}

}  // namespace pliant::deal
