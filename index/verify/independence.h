// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How much the inliers of a verification say together. Private to index/.
#pragma once

#include <vector>

#include "descriptor/features/features.h"
#include "index/records/location.h"

namespace pliant {

// Inliers side by side see the same detail, and are right or wrong together: what two objects have
// in common (a map on every note of a series), or an edge that agrees by chance, has many of them
// in a small place. So each inlier counts as 1 / n, n the inliers (itself included) within
// `query_radius` pixels of it in the query or within `reference_radius` in the reference. Returns
// the sum: `inliers.size()` where all stand apart, 1 where all lie in one place.
double IndependentInliers(const Features& query, const Features& reference,
                          const std::vector<MatchedPair>& inliers, double query_radius,
                          double reference_radius);

}  // namespace pliant
