// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Placement of the camera.
#pragma once

#include "descriptor/simulation/scene.h"

namespace pliant::simulation {

// In-plane rotation 0..360 degrees, scale 0.3..2, tilt to 60 degrees.
Framing DrawFraming(Random& random, float strength);
// Nearly upright, frontal and filling the picture.
Framing DrawFrontalFraming(Random& random);

// A camera for the pose. `facing_u`: which part of a tube faces the camera (0.5 = its
// front).
Camera PlaceCamera(const Body& body, const Pose& pose, const Framing& framing, float facing_u,
                   int width, int height);

}  // namespace pliant::simulation
