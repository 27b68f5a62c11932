// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The preset street: small things in photographs of a scene. Internal.
#pragma once

#include "descriptor/simulation/view.h"

namespace pliant::simulation {

// Fills a scene: view 0 is the artwork (or the object) as in a catalogue, the others are
// photographs in which it is 55 to 220 pixels wide, printed on a shirt or another cloth (bare
// ground, cloth of another colour, fine wrinkles) or all of a note, poster, can or bag; some are
// then enlarged.
void FillStreet(Stage& stage, Random& random, Scene& scene);

}  // namespace pliant::simulation
