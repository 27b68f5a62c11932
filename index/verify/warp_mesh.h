// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A warp as a mesh of points, for whoever has no spline at hand: a browser that draws the bent
// outline or un-crumples the object, a tracker that hands its map on.
#pragma once

#include <vector>

#include "descriptor/warp/tps.h"

namespace pliant {

// A regular grid over the reference picture, corner to corner, and where each of its points lies in
// the query picture. Point (column c, row r) of the grid is the reference pixel
//   (c (reference_width - 1) / (columns - 1), r (reference_height - 1) / (rows - 1)),
// pixel centres at integers.
struct Mesh {
  int columns = 0;  // points, not cells
  int rows = 0;
  int reference_width = 0;  // of the original upright reference picture, in pixels
  int reference_height = 0;
  std::vector<Vec2> points;  // rows x columns, row-major; pixels of the original query picture
  // rows x columns: whether the map can be believed there. Where it was not seen a spline
  // extrapolates: a point is out when the map mirrors there or its scale is far from the median.
  std::vector<bool> trusted;

  Vec2 reference_point(int column, int row) const {
    return {column * (reference_width - 1.0) / (columns - 1),
            row * (reference_height - 1.0) / (rows - 1)};
  }
};

// The mesh of a map reference -> query: `longer_side` points on the reference's longer side, as
// many on the shorter as keep the cells nearly square, at least 2. Throws kInvalidArgument for a
// picture narrower than 2 pixels or longer_side outside 2..256.
Mesh WarpMesh(const ThinPlateSpline& query_from_reference, int reference_width,
              int reference_height, int longer_side = 17);

}  // namespace pliant
