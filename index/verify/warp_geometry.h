// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Geometry of warped images: outlines, hulls, and the warp as a mesh of points.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "descriptor/features/features.h"
#include "descriptor/warp/tps.h"
#include "index/records/explanation.h"
#include "index/records/location.h"

namespace pliant {

// The positions of one side of the pairs: `which` is &MatchedPair::query or
// &MatchedPair::reference.
std::vector<Vec2> PointsOf(const std::vector<Keypoint>& keypoints,
                           const std::vector<MatchedPair>& pairs,
                           std::uint32_t MatchedPair::* which);

// Corners of the convex hull, turning from the x axis towards the y axis, without points on its
// edges.
std::vector<Vec2> ConvexHull(std::vector<Vec2> points);

// The polygon, scaled about the mean of its corners.
std::vector<Vec2> Enlarged(std::span<const Vec2> polygon, double factor);

// Whether the point lies inside the polygon, by the even-odd rule.
bool IsInside(Vec2 point, std::span<const Vec2> polygon);
// Whether at least half of the points lie inside.
bool HalfInside(std::span<const Vec2> points, std::span<const Vec2> polygon);

// Whether any two sides that are not neighbours touch.
bool CrossesItself(std::span<const Vec2> polygon);

// The median of the values, the upper one of two. `values` must not be empty.
double Median(std::vector<double> values);

// sqrt of the Jacobian's determinant: query pixels per reference pixel; -1 where the warp mirrors.
double LocalScale(const ThinPlateSpline& warp, Vec2 p);

// The frame of a width x height image through the warp, 8 points per side.
std::vector<Vec2> WarpFrame(const ThinPlateSpline& warp, int width, int height);

// The map reference -> query as a mesh, for programs without splines. It has `longer_side` points
// along the reference's longer side. Along the shorter side it has at least 2, so that the cells
// are nearly square. Throws kInvalidArgument for an image narrower than 2 pixels or longer_side
// outside 2..256.
Mesh WarpMesh(const ThinPlateSpline& query_from_reference, int reference_width,
              int reference_height, int longer_side = 17);

}  // namespace pliant
