// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What stands around the object: the picture behind it and things in front of it.
#pragma once

#include <vector>

#include "descriptor/simulation/random.h"
#include "descriptor/simulation/renderer.h"
#include "descriptor/simulation/texture.h"

namespace pliant::simulation {

// height x width colours: a part of `texture`, turned, perhaps out of focus; or, when it is null,
// a soft gradient.
std::vector<Colour> DrawBackdrop(Random& random, const Texture* texture, int width, int height);

// Lays up to three opaque things (a strip, a disc, a finger-like capsule) over the frame and takes
// what they hide out of the truth. `texture` (may be null) colours some of them.
void DrawOccluders(Random& random, const Texture* texture, Frame& frame);

}  // namespace pliant::simulation
