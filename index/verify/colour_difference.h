// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How much the colours of two images differ where both show the same. Private to index/.
#pragma once

#include <optional>
#include <span>

#include "descriptor/features/features.h"
#include "descriptor/warp/tps.h"

namespace pliant {

// Mean distance of the chroma (CIELAB's a* and b*) between points of the reference inside `seen`
// (convex, the part that the query shows) and their places in the query by `warp` (reference ->
// query, pixels), after subtraction of the median difference, which the light makes. `scale`: query
// pixels per reference pixel. Nothing if an image has no colours, or too few points are seen.
std::optional<double> ColourDifference(const Features& query, const Features& reference,
                                       const ThinPlateSpline& warp, std::span<const Vec2> seen,
                                       double scale);

}  // namespace pliant
