// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A warp as a mesh of points, for whoever has no spline at hand: a browser that draws the bent
// outline or un-crumples the object, a tracker that hands its map on.
#pragma once

#include <vector>

#include "descriptor/warp/tps.h"
#include "index/records/explanation.h"

namespace pliant {

// The mesh of a map reference -> query: `longer_side` points on the reference's longer side, as
// many on the shorter as keep the cells nearly square, at least 2. Throws kInvalidArgument for an
// image narrower than 2 pixels or longer_side outside 2..256.
Mesh WarpMesh(const ThinPlateSpline& query_from_reference, int reference_width,
              int reference_height, int longer_side = 17);

}  // namespace pliant
