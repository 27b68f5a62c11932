// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What readers of the OpenAPI document find a route under.
#pragma once

#include <string>
#include <vector>

#include "server/http/json.h"
#include "server/http/router.h"

namespace pliant::server {

// "images" of "images.create"; what has no point has one of its own, or one for several.
std::string TagOf(const Route& route);

// Those that the routes use, with descriptions. A tag that has none yet is described by its name; a
// test finds that.
Json TagsOf(const std::vector<Route>& routes);

}  // namespace pliant::server
