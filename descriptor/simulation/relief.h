// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Wrinkles and knit that are finer than the mesh: slopes over a chart that change how bright it is.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "descriptor/simulation/random.h"

namespace pliant::simulation {

class Relief {
 public:
  // Creases and waves of root mean square slope `steepness` on a chart of this height / width.
  Relief(Random& random, float aspect, float steepness);

  // Slope along u and v at a place, bilinear.
  Eigen::Array2f Slope(float u, float v) const;

 private:
  int columns_ = 0;
  int rows_ = 0;
  std::vector<Eigen::Array2f> slopes_;
};

}  // namespace pliant::simulation
