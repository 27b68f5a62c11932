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

#include "descriptor/deal/backbone.h"
#include "descriptor/deal/hardnet.h"
#include "descriptor/deal/localization.h"
#include "descriptor/deal/weights.h"
#include "descriptor/features/features.h"
#include "descriptor/image/image.h"

namespace pliant::deal {

// Support radii of one description, relative to that of the weights. With several, the result is
// the mean of their descriptors, scaled to unit length (domain-size pooling: Dong and Soatto, CVPR
// 2015).
inline constexpr std::array<float, 1> kOneSupport = {1.0F};
inline constexpr std::array<float, 3> kPooledSupports = {0.72F, 1.0F, 1.39F};

// Immutable and thread-safe. `threads` counts threads, at least 1.
class DealNetwork {
 public:
  explicit DealNetwork(DealWeights weights);
  ~DealNetwork();

  const DealWeights& weights() const { return *weights_; }
  const Backbone& backbone() const { return backbone_; }
  const LocalizationNet& localization() const { return localization_; }

  // Throws kInvalidArgument for a picture that is not grey or is empty, kTooLarge above
  // kMaxPixels.
  static constexpr std::int64_t kMaxPixels = std::int64_t{1} << 24;
  static GreyPicture ToPicture(const Image& grey);

  // Throws kInvalidArgument naming the first key point that is not finite or has no positive size.
  static void CheckKeypoints(std::span<const Keypoint> keypoints);

  // count x 2 x kPatchPixels in units of R: x values, then y values, of each key point. One
  // product of theta (count x kTpsParameters x 2) with the constant basis.
  std::vector<float> Displacements(std::span<const float> theta, int threads) const;

  // keypoints.size() x 32 x 32. `theta` empty: the fixed polar grid.
  std::vector<float> Patches(const GreyPicture& picture, std::span<const Keypoint> keypoints,
                             std::span<const float> theta, int threads) const;

  // count x kPatchPixels to count x kDescriptorDim, unit length.
  std::vector<float> DescribePatches(std::span<const float> patches, int threads) const;

  // keypoints.size() x kDescriptorDim from the picture, batch by batch. The warp of a key point, in
  // radii, is the same for all supports.
  std::vector<float> Describe(const Image& grey, std::span<const Keypoint> keypoints, bool warp,
                              std::span<const float> supports, int threads) const;

 private:
  struct Impl;
  std::shared_ptr<const DealWeights> weights_;
  Backbone backbone_;
  LocalizationNet localization_;
  HardNet hardnet_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pliant::deal
