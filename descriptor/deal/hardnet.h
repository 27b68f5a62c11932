// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// HardNet on polar patches (Mishchuk et al. 2017; paper, section 3.3): rows are angles, so every
// convolution is circular in them and the mean over rows makes the descriptor rotation-invariant.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "descriptor/deal/hardnet_body.h"
#include "descriptor/deal/primitives.h"
#include "descriptor/deal/weights.h"

namespace pliant::deal {

// Scales a row to unit length. As in PyTorch's normalize, lengths below 1e-12 are
// replaced by 1e-12.
void NormalizeLength(std::span<float> row);

// Immutable and thread-safe; workers hold the mutable state. The head has no non-linearity, so its
// layers are one product.
class HardNet {
 public:
  static constexpr std::size_t kBatch = HardNetBody::kBatch;

  // `type`: of the convolutions' maps and weights, f32 or bf16.
  HardNet(const DealWeights& weights, dnnl::memory::data_type type);

  std::size_t dim() const { return static_cast<std::size_t>(head_.shape().columns); }

  // Scratch memory for one thread at a time. `net` must outlive it.
  class Worker {
   public:
    explicit Worker(const HardNet& net);

    // Patches count x 32 x 32 (rows = angle) to count x dim(), unit length; count <= kBatch.
    // oneDNN must be set to one thread (ScopedPrimitiveThreads).
    void Run(const float* patches, std::size_t count, float* descriptors);

   private:
    const HardNet& net_;
    std::unique_ptr<HardNetBody::Worker> body_;
    dnnl::stream stream_{CpuEngine()};
    AlignedFloats pooled_, scratch_, result_;
  };

 private:
  std::unique_ptr<HardNetBody> body_;
  ProductPrimitive head_;
};

}  // namespace pliant::deal
