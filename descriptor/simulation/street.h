// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The preset street: small things in photographs of a scene. Internal.
#pragma once

#include "descriptor/simulation/scene.h"
#include "descriptor/simulation/view.h"

namespace pliant::simulation {

// Placement of the camera.

// In-plane rotation 0..360 degrees, scale 0.3..2, tilt to 60 degrees.
Framing DrawFraming(Random& random, float strength);
// Nearly upright, frontal and filling the image.
Framing DrawFrontalFraming(Random& random);

// A camera for the pose. `facing_u`: which part of a tube faces the camera (0.5 = its
// front).
Camera PlaceCamera(const Body& body, const Pose& pose, const Framing& framing, float facing_u,
                   int width, int height);

// Fills a scene: view 0 is the artwork (or the object) as in a catalogue, the others are
// photographs in which it is 55 to 220 pixels wide, printed on a shirt or another cloth (bare
// ground, cloth of another colour, fine wrinkles) or all of a note, poster, can or bag; some are
// then enlarged.
void FillStreet(Stage& stage, Random& random, Scene& scene);

}  // namespace pliant::simulation
