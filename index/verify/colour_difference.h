// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How much the colours of two images differ where they show the same. Private to index/.
#pragma once

#include <optional>
#include <span>

#include "descriptor/features/features.h"
#include "descriptor/warp/tps.h"

namespace pliant {

// Mean distance of the chroma (CIELAB's a* and b*) of points of the reference inside `seen`
// (convex, the part that the query shows) and where `warp` (reference -> query, pixels) has them in
// the query, after the median difference, which is the light's, was taken off. `scale`: query
// pixels per reference pixel. Nothing where either image has no colours, or too few points are
// seen.
std::optional<double> ColourDifference(const Features& query, const Features& reference,
                                       const ThinPlateSpline& warp, std::span<const Vec2> seen,
                                       double scale);

}  // namespace pliant
