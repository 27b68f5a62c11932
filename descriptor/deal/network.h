// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// DEAL (Potje et al., NeurIPS 2021): the stages and the whole network. Internal to deal/; tests
// compare each stage with the golden tensors, benchmarks time it.
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "descriptor/deal/hardnet.h"
#include "descriptor/deal/primitives.h"
#include "descriptor/deal/weights.h"
#include "descriptor/features/enlarged_keypoints.h"
#include "descriptor/features/features.h"
#include "descriptor/image/image.h"

namespace pliant::deal {

// The constants of the second spatial transformer (paper, section 3.2): polar grid and
// thin-plate-spline basis. Because the grid is normalised by the half width of the paper's grid,
// the linear one, both are the same for every keypoint, image and radius.
//
// The paper's grid has its rings at equal distances. On a logarithmic one (Ebel et al., "Beyond
// Cartesian Representations for Local Descriptors", ICCV 2019) another keypoint size is a shift
// along the rows of the patch, which convolutions and their strides tolerate, and the outer rings,
// where the surroundings of small objects lie, have fewer points.

// kPatchPixels x offsets, then as many y offsets, in units of the support radius R, angle-major.
// With t = (j + 0.5) / 32, point (i, j) lies at angle 2 pi (i + 0.5) / 32 and radius t (kLinear) or
// 32^(t - 1) (kLogarithmic).
std::vector<float> UnitPolarGrid(RadialSpacing spacing);

// kPatchPixels x kTpsParameters, row-major. Row of grid point q, in box coordinates (the grid
// scaled to occupy 0.3 of the unit square, centred):
//   rho(|q - c_1|) - rho(|q - c_0|), ..., rho(|q - c_63|) - rho(|q - c_0|), 1, q_x, q_y
// with rho(d) = d^2 log(d + 1e-6) and c_k the points of every fourth row and column of the linear
// grid, whatever the spacing, so that a warp is the same field on both. This is the reduced form of
// the spline: the first weight is minus the sum of the others.
std::vector<float> TpsBasis(RadialSpacing spacing);

// Factor from box coordinates to units of R: displacement = gain * basis * theta.
double DisplacementGain();

// The backbone (paper, section 3.1): ResNet-34 up to and including its second residual stage, on a
// grey image. A map of 128 channels (the weights may have fewer) at an eighth of the image's size.

// A grey image in [0, 1], row-major.
struct GreyImage {
  int height = 0;
  int width = 0;
  std::vector<float> values;
};

// X of the paper: height x width x channels, with the size of the image it came from.
struct FeatureMap {
  int height = 0;
  int width = 0;
  int channels = 0;
  int image_height = 0;
  int image_width = 0;
  std::vector<float> values;
};

class SizedBackbone;  // for one size of image and one number of threads

// Thread-safe: each call has its own primitives and buffers, which later calls reuse for images
// of the same size. `type`, here and below: of maps and weights in between, f32 or bf16.
class Backbone {
 public:
  Backbone(std::shared_ptr<const DealWeights> weights, dnnl::memory::data_type type);
  ~Backbone();

  FeatureMap Run(const GreyImage& image, int threads) const;

 private:
  std::shared_ptr<const DealWeights> weights_;
  dnnl::memory::data_type type_;
  mutable Pool<SizedBackbone> pool_;
};

// First spatial transformer (paper, section 3.1): the map's 5 x 5 neighbourhood of each keypoint
// through a small network to the parameters of its thin-plate-spline warp.

inline constexpr std::size_t kIdleWorkers = 64;  // kept for later calls

// Immutable and thread-safe.
class LocalizationNet {
 public:
  LocalizationNet(const DealWeights& weights, dnnl::memory::data_type type);

  // The network's input, keypoints.size() x 25 x channels: rows of the neighbourhood slowest,
  // channels fastest. Image pixel x lies at cell x (w - 1) / (W - 1).
  static void Sample(const FeatureMap& map, std::span<const Keypoint> keypoints, float* samples);

  // theta, keypoints.size() x kTpsParameters x 2 (x, y), in (-1, 1).
  std::vector<float> Theta(const FeatureMap& map, std::span<const Keypoint> keypoints,
                           int threads) const;

 private:
  static constexpr std::size_t kLayers = 4;
  // Buffers of one thread: the input of each layer, of its type, and the last one's result.
  struct Worker {
    std::array<AlignedFloats, kLayers + 1> values;
    AlignedFloats scratch;
    dnnl::stream stream{CpuEngine()};
  };
  std::unique_ptr<Worker> MakeWorker() const;
  dnnl::memory::data_type LayerType(std::size_t layer) const;  // of its input and weights

  dnnl::memory::data_type type_;
  std::vector<ProductPrimitive> large_, small_;  // kLayers of them, for one batch size each
  mutable Pool<Worker> pool_{kIdleWorkers};
};

// Support radii of one description, relative to that of the weights. With several, the result is
// the mean of their descriptors, scaled to unit length (domain-size pooling: Dong and Soatto, CVPR
// 2015).
inline constexpr std::array<float, 1> kOneSupport = {1.0F};
inline constexpr std::array<float, 3> kPooledSupports = {0.72F, 1.0F, 1.39F};

// Immutable and thread-safe. `threads` counts threads, at least 1.
class DealNetwork {
 public:
  explicit DealNetwork(DealWeights weights, dnnl::memory::data_type type = FastestType());

  const DealWeights& weights() const { return *weights_; }
  std::size_t dim() const { return hardnet_.dim(); }  // of a descriptor
  const Backbone& backbone() const { return backbone_; }
  const LocalizationNet& localization() const { return localization_; }

  // Throws kInvalidArgument for an image that is not grey or is empty, kTooLarge above
  // kMaxPixels.
  static constexpr std::int64_t kMaxPixels = std::int64_t{1} << 24;
  static GreyImage ToImage(const Image& grey);

  // count x 2 x kPatchPixels in units of R: x values, then y values, of each keypoint. One
  // product of theta (count x kTpsParameters x 2) with the constant basis.
  std::vector<float> Displacements(std::span<const float> theta, int threads) const;

  // keypoints.size() x 32 x 32. `shifts`: Displacements; empty: the fixed polar grid. `support`: of
  // the weights' radius; the warp, in radii, is the same for all supports.
  std::vector<float> Patches(const GreyImage& image, std::span<const Keypoint> keypoints,
                             std::span<const float> shifts, float support, int threads) const;

  // count x kPatchPixels to count x dim(), unit length.
  std::vector<float> DescribePatches(std::span<const float> patches, int threads) const;

  // Rows of dim() values: all stages. First those of `keypoints`, then those of `finer`, whose
  // patches come from its images, and whose warps from `grey`.
  std::vector<float> Describe(const Image& grey, std::span<const Keypoint> keypoints, bool warp,
                              std::span<const float> supports, int threads,
                              std::span<const EnlargedKeypoints> finer = {}) const;

 private:
  // Buffers of one thread, for batches of keypoints.
  struct Worker {
    explicit Worker(const DealNetwork& network);

    HardNet::Worker hardnet;
    dnnl::stream stream{CpuEngine()};
    AlignedFloats parameters, shifts, scratch;
  };

  Pool<Worker>::Lease TakeWorker() const;
  // From patches on. theta: empty, or of the keypoints.
  void DescribeWarped(const Image& grey, std::span<const Keypoint> keypoints,
                      std::span<const float> theta, std::span<const float> supports, int threads,
                      float* rows) const;

  std::shared_ptr<const DealWeights> weights_;
  Backbone backbone_;
  LocalizationNet localization_;
  HardNet hardnet_;
  ProductPrimitive warp_;
  std::vector<float> grid_;  // kPatchPixels x values, then as many y values
  mutable Pool<Worker> pool_{kIdleWorkers};
};

}  // namespace pliant::deal
