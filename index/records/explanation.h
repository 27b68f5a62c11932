// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Why verification confirmed a hit or did not. Plain values.
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
  // rows x columns: whether the map is reliable there. A spline extrapolates to unseen parts. A
  // point is not trusted if the map mirrors there or its scale is far from the median.
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

// What the pixels say, where the details match: whether it is this object, or one that shares
// details with it.
struct Appearance {
  double seen_again = 0;  // share of the reference's texture that the query shows again, 0..1
  // Mean colour difference of the visible part, corrected for the light, per strength of the
  // reference's colours; absent if unknown.
  std::optional<double> colour_difference;
};

struct Explanation {
  double ranking_score = 0;  // of the ranking, before verification raised it
  bool verified = false;
  std::string failure;             // the reason, a sentence; empty when verified
  int matches = 0;                 // tentative: mutual nearest neighbours within the ratio
  double inlier_fraction = 0;      // of the matches
  double independent_inliers = 0;  // effective inlier count (EffectiveInliers)
  // Mean colour difference of the visible part (CIELAB's a* and b*), corrected for the light.
  // Absent if one of the images is grey or was indexed without colours, if too little is visible,
  // or without inliers.
  std::optional<double> colour_difference;
  std::optional<Appearance> appearance;  // absent without strong evidence or without previews
  std::vector<PointPair> inliers;        // the matches that fit the warp
  std::optional<Mesh> mesh;              // the warp, hit's image -> query image; when verified
  int reference_width = 0;               // of the hit's original upright image; 0 = not verified
  int reference_height = 0;
};

}  // namespace pliant
