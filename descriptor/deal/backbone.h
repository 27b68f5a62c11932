// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The backbone (paper, section 3.1): ResNet-34 up to and including its second residual stage, on a
// grey picture. A map of 128 channels at an eighth of the picture's size.
#pragma once

#include <memory>
#include <vector>

#include "descriptor/deal/weights.h"

namespace pliant::deal {

// A grey picture in [0, 1], row-major.
struct GreyPicture {
  int height = 0;
  int width = 0;
  std::vector<float> values;
};

// X of the paper: height x width x kFeatureChannels, with the size of the picture it came from.
struct FeatureMap {
  int height = 0;
  int width = 0;
  int picture_height = 0;
  int picture_width = 0;
  std::vector<float> values;
};

// Thread-safe: each call has its own primitives and buffers, which later calls reuse for pictures
// of the same size.
class Backbone {
 public:
  explicit Backbone(std::shared_ptr<const DealWeights> weights);
  ~Backbone();

  FeatureMap Run(const GreyPicture& picture, int threads) const;

  // Multiply-adds of one run, for benchmarks.
  static double MultiplyAdds(int height, int width);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pliant::deal
