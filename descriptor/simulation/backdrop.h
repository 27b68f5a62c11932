// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The surroundings of the object: the picture behind it and occluders in front of it.
#pragma once

#include <vector>

#include "descriptor/simulation/random.h"
#include "descriptor/simulation/renderer.h"
#include "descriptor/simulation/texture.h"

namespace pliant::simulation {

// height x width colours: a part of `texture`, rotated, perhaps out of focus; or a soft gradient
// when it is null.
std::vector<Colour> DrawBackdrop(Random& random, const Texture* texture, int width, int height);

// Draws up to three opaque occluders (a strip, a disc, a finger-like capsule) over the frame and
// removes the ground truth of hidden pixels. `texture` (may be null) colours some of them.
void DrawOccluders(Random& random, const Texture* texture, Frame& frame);

}  // namespace pliant::simulation
