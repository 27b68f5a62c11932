// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The colour difference of two images where both show the same. Private to index/.
#pragma once

#include <optional>
#include <span>

#include "descriptor/features/features.h"
#include "index/records/explanation.h"

namespace pliant {

// Mean distance of the chroma (CIELAB's a* and b*) between points of the reference inside `seen`
// (convex, the part that the query shows) and their positions in the query by `mesh` (WarpMesh).
// The median difference, which comes from the light, is subtracted. `scale`: query pixels per
// reference pixel. nullopt if an image has no colours, or too few points are visible.
std::optional<double> ColourDifference(const Features& query, const Features& reference,
                                       const Mesh& mesh, std::span<const Vec2> seen, double scale);

// The same relative to the reference's colours. They are faded first as those of the query are: by
// the least squares gain g, 0.3 or more. The mean distance is divided by 4 + g times the mean
// strength of the reference's colours.
std::optional<double> RelativeColourDifference(const Features& query, const Features& reference,
                                               const Mesh& mesh, std::span<const Vec2> seen,
                                               double scale);

}  // namespace pliant
