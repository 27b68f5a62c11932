// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which problem codes a route can answer with: those that follow from its form, and its own.
#pragma once

#include <set>
#include <string>

#include "server/http/router.h"

namespace pliant::server {

std::set<std::string> RouteCodes(const Route& route);

}  // namespace pliant::server
