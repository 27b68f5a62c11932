// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Outlines of warped images.
#pragma once

#include <span>
#include <vector>

#include "descriptor/warp/tps.h"

namespace pliant {

// Corners of the convex hull, turning from the x axis towards the y axis, without points on its
// edges.
std::vector<Vec2> ConvexHull(std::vector<Vec2> points);

// Whether the point lies inside the polygon, by the even-odd rule.
bool IsInside(Vec2 point, std::span<const Vec2> polygon);

// Whether any two sides that are not neighbours touch.
bool CrossesItself(std::span<const Vec2> polygon);

// The frame of a width x height image through the warp, `points_a_side` points per side.
std::vector<Vec2> WarpFrame(const ThinPlateSpline& warp, int width, int height, int points_a_side);

// Whether the warp keeps its orientation along the frame and on a grid inside, and its local scale
// there within `max_factor` of `scale` (query pixels per reference pixel).
bool MapsFrameSanely(const ThinPlateSpline& warp, int width, int height, double scale,
                     double max_factor);

}  // namespace pliant
