// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// First spatial transformer (paper, section 3.1): the map's 5 x 5 neighbourhood of each key point
// through a small network to the parameters of its thin-plate-spline warp.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "descriptor/deal/backbone.h"
#include "descriptor/features/features.h"

namespace pliant::deal {

// Immutable and thread-safe.
class LocalizationNet {
 public:
  explicit LocalizationNet(const DealWeights& weights);
  ~LocalizationNet();

  // keypoints.size() x kSampledValues, rows of the neighbourhood slowest, channels fastest.
  // Picture pixel x lies at cell x (w - 1) / (W - 1).
  std::vector<float> Sample(const FeatureMap& map, std::span<const Keypoint> keypoints,
                            int threads) const;

  // theta: keypoints.size() x kTpsParameters x 2 (x, y), in (-1, 1).
  std::vector<float> Theta(const FeatureMap& map, std::span<const Keypoint> keypoints,
                           int threads) const;

  // theta from sampled values, count x kSampledValues.
  std::vector<float> ThetaFromSamples(std::span<const float> samples, int threads) const;

  double multiply_adds() const;  // per key point

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pliant::deal
