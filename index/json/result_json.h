// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The JSON forms of search results, comparisons and locations, for the command line and the HTTP
// server.
#pragma once

#include <vector>

#include "index/json/json.h"
#include "index/records/records.h"
#include "index/records/search.h"
#include "index/verify/locate.h"
#include "index/verify/warp_geometry.h"

namespace pliant {

// {"took_ms", "vocabulary", "words", "keypoints", "query": {"width", "height"}, "total", "verdict":
// "found", "perhaps", "not_found" or null, "found": number or null, "hits": [{"rank", "object",
// "score", "probability": number or null, "verdict": "found", "perhaps", "unlikely" or null,
// "image_id", "inliers", "polygon", "instances":
// [{"inliers", "polygon"}], "metadata"}], "timings": {...}}. An object without a name is null; the
// polygon is a list of [x, y] or null. A hit with an explanation has "explain" too:
// {"ranking_score", "verified", "failure": text or null, "matches", "inlier_fraction",
// "independent_inliers", "colour_difference": number or null, "pairs": [[query x, query y,
// reference x, reference y], ...], "reference": {"width", "height"} or null, "mesh": MeshJson's or
// null}. In a search by several examples "query" is null, every hit has "example", and there is
// "examples": [{"image_id", "keypoints", "width", "height"}].
Json SearchResultJson(const SearchResult& result, double took_ms);

// {"took_ms", "verdict": "found", "perhaps" or "not_found", "probability", "first": {"width",
// "height", "keypoints"}, "second": the same, "matches", "inliers", "inlier_fraction", "polygon",
// "failure": text or null, "timings": {...}}, and as asked "explain" as above.
Json ComparisonJson(const Comparison& comparison, double took_ms, bool explain);

// [x, y], with hundredths of a pixel.
Json PointJson(Vec2 point);

// {"columns", "rows", "reference_width", "reference_height", "points": [[x, y], ...],
// "trusted": [true, ...]}.
Json MeshJson(const Mesh& mesh);

// {"found", "reason": word or null, "keypoints", "matches", "inliers", "inlier_rate",
// "outline": [[x, y], ...] or null, "mesh": MeshJson or null}.
Json LocationJson(const Location& location);

}  // namespace pliant
