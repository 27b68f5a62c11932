// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Simulated photos of a picture: it bends, lies somewhere, is lit and photographed.
#pragma once

#include <cstdint>
#include <vector>

#include "descriptor/image/image.h"

namespace pliant {

struct SimulatedPhoto {
  Image image;       // R, G, B
  double share = 0;  // of its area that shows the object, 0..1
};

// Thread-safe.
class Photographer {
 public:
  Photographer();

  // `picture`: R, G, B. `strength`, above 0 and at most 1: of deformation, light and noise. The
  // same arguments give the same photo. Throws kInternal "simulation_diverged".
  SimulatedPhoto Take(const Image& picture, double strength, std::uint64_t number) const;

 private:
  std::vector<Image> surroundings_;
};

}  // namespace pliant
