// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// HardNet on polar patches (Mishchuk et al. 2017; paper, section 3.3): rows are angles, so every
// convolution is circular in them and the mean over rows makes the descriptor rotation-invariant.
#pragma once

#include <cstddef>
#include <vector>

#include "descriptor/deal/kernels.h"
#include "descriptor/deal/primitives.h"
#include "descriptor/deal/weights.h"

namespace pliant::deal {

// Weights for Winograd's F(4x4, 3x3) convolution and for HardNet's linear head. Internal to deal/.

// G g G^T (Lavin and Gray 2016, section 4.3): kTilePlanes matrices of inputs x outputs.
std::vector<float> WinogradWeights(const ConvLayer& layer);

// An affine map from `inputs` to `outputs` values, weight inputs x outputs.
struct AffineMap {
  int inputs = 0;
  int outputs = 0;
  std::vector<float> weight;
  std::vector<float> bias;
};

// The layers of the head as one map from columns x channels values, channels fastest.
AffineMap FuseHead(const std::vector<ConvLayer>& head);

// Scales a row to unit length. As in PyTorch's normalize, lengths below 1e-12 are
// replaced by 1e-12.
void NormalizeLength(std::span<float> row);

// Immutable and thread-safe; workers hold the mutable state.
//
// Performance: the stride-1 layers use Winograd's F(4x4, 3x3), whose input transform reads the
// wrapped rows in place, so padding needs no copy; its output transform writes the next layer's
// buffer, of which only the one wrapped row is copied (the stride-2 layers are oneDNN convolutions
// and need it). oneDNN's own convolutions cannot write into the inside of a padded buffer: they
// fall back to its reference code. Everything stays channels-last. The head has no non-linearity,
// so its layers are one product.
class HardNet {
 public:
  static constexpr std::size_t kBatch = 16;  // maximum number of patches per Worker::Run

  explicit HardNet(const DealWeights& weights);
  ~HardNet();

  std::size_t dim() const { return static_cast<std::size_t>(head_.shape().columns); }

  // Scratch memory for one thread at a time. `net` must outlive it.
  class Worker {
   public:
    explicit Worker(const HardNet& net);

    // Patches count x 32 x 32 (rows = angle) to count x dim(), unit length; count <= kBatch.
    // oneDNN must be set to one thread (ScopedPrimitiveThreads).
    void Run(const float* patches, std::size_t count, float* descriptors);

   private:
    void FirstLayer(const float* patches, std::size_t count);
    void MultiplyTiles(std::size_t stage, const float* from, std::size_t count);
    void WriteWrapped(std::size_t stage, std::size_t first, std::size_t count);
    void RunConv(const ConvPrimitive& conv, float* source, float* destination);

    const HardNet& net_;
    const Kernels& kernels_ = BestKernels();
    dnnl::stream stream_{CpuEngine()};
    AlignedFloats framed_, pooled_, scratch_, tiles_, products_, result_;
    std::vector<AlignedFloats> inputs_, wrapped_;  // of the stride-1 and the stride-2 layers
  };

 private:
  struct Stage;

  HardNet(const DealWeights& weights, const ScopedPrimitiveThreads& one);
  std::size_t scratch_bytes() const;

  int first_channels_, first_stride_;
  std::vector<float> first_weight_, first_bias_;
  std::vector<Stage> stages_;
  std::vector<ConvPrimitive> strided_;  // after all stages but the last
  ProductPrimitive head_;
};

}  // namespace pliant::deal
