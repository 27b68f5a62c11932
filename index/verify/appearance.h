// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Compares pixels of two images where both show the same, to tell an object from its siblings:
// objects of one series share details that match, and differ elsewhere. Private to index/.
#pragma once

#include <optional>

#include "descriptor/features/features.h"
#include "index/records/explanation.h"
#include "index/verify/verification.h"

namespace pliant {

// Rectifies the query's preview by the instance's warp and correlates it with the reference's, in
// windows of a fourteenth of its longer side, each at the best of 25 displacements. nullopt without
// a warp, if an image has no preview, if the object is too small, or if the reference has no
// texture.
std::optional<Appearance> CompareAppearance(const Features& query, const Features& reference,
                                            const FoundInstance& found);

}  // namespace pliant
