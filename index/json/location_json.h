// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The JSON forms of meshes and locations.
#pragma once

#include <vector>

#include "index/json/json.h"
#include "index/records/explanation.h"
#include "index/verify/locate.h"

namespace pliant {

// [x, y], with hundredths of a pixel.
Json PointJson(Vec2 point);

// {"columns", "rows", "reference_width", "reference_height", "points": [[x, y], ...],
// "trusted": [true, ...]}.
Json MeshJson(const Mesh& mesh);

// {"found", "reason": word or null, "keypoints", "matches", "inliers", "inlier_rate",
// "outline": [[x, y], ...] or null, "mesh": MeshJson or null}.
Json LocationJson(const Location& location);

}  // namespace pliant
