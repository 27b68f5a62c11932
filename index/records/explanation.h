// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Why an image is a hit, or was not confirmed as one. Plain values.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "descriptor/warp/tps.h"

namespace pliant {

// A regular grid over the reference image, corner to corner, and where each of its points lies in
// the query image. Point (column c, row r) of the grid is the reference pixel
//   (c (reference_width - 1) / (columns - 1), r (reference_height - 1) / (rows - 1)),
// pixel centres at integers.
struct Mesh {
  int columns = 0;  // points, not cells
  int rows = 0;
  int reference_width = 0;  // of the original upright reference image, in pixels
  int reference_height = 0;
  std::vector<Vec2> points;  // rows x columns, row-major; pixels of the original query image
  // rows x columns: whether the map can be believed there. Where it was not seen a spline
  // extrapolates: a point is out when the map mirrors there or its scale is far from the median.
  std::vector<bool> trusted;

  Vec2 reference_point(int column, int row) const {
    return {column * (reference_width - 1.0) / (columns - 1),
            row * (reference_height - 1.0) / (rows - 1)};
  }
};

struct PointPair {
  Vec2 query;      // pixels of the original upright query image
  Vec2 reference;  // pixels of the original upright image of the hit
};

struct Explanation {
  double ranking_score = 0;  // by words alone, before verification lifted it
  bool verified = false;
  std::string failure;             // a sentence that says why not; empty when verified
  int matches = 0;                 // tentative: mutual nearest neighbours within the ratio
  double inlier_fraction = 0;      // of the matches
  double independent_inliers = 0;  // the inliers, each divided by how many lie in its place
  // Mean difference of the colours of what is seen (CIELAB's a* and b*), but for the light's;
  // nothing where one of the images is grey or was indexed without colours, where too little is
  // seen, or nothing agrees.
  std::optional<double> colour_difference;
  std::vector<PointPair> inliers;  // the matches that agree with the warp
  std::optional<Mesh> mesh;        // the warp, hit's image -> query image; when verified
  int reference_width = 0;         // of the hit's original upright image; 0 = not looked at
  int reference_height = 0;
};

}  // namespace pliant
