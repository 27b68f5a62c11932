// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The JSON forms of search results, comparisons and locations, for the command line and the HTTP
// server. server/reference/search.md documents the fields.
#pragma once

#include "index/json/json.h"
#include "index/records/search.h"
#include "index/verify/locate.h"
#include "index/verify/warp_geometry.h"

namespace pliant {

Json SearchResultJson(const SearchResult& result, double took_ms);
// `explain`: with "explain", as hits have it.
Json ComparisonJson(const Comparison& comparison, double took_ms, bool explain);
Json MeshJson(const Mesh& mesh);
Json LocationJson(const Location& location);

}  // namespace pliant
