// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The problem codes with which a route can answer: those implied by its declaration, and its own.
#pragma once

#include <set>
#include <string>

#include "server/http/router.h"

namespace pliant::server {

bool HasEtag(const Route& route);     // its answer has one, and the conditions of a GET count
bool TakesRange(const Route& route);  // parts of its answer can be asked for

std::set<std::string> RouteCodes(const Route& route);

}  // namespace pliant::server
