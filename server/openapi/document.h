// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The OpenAPI 3.1 document, generated from the route table.
//
// Each operation has an example as `x-codeSamples`: a shell command for a folder with the images
// mug.png and cup.png. It uses these variables:
//   $PLIANT      address of the server, http://127.0.0.1:8080
//   $IMAGE       id of a stored image of the object "mug"
//   $VOCABULARY  number of a vocabulary
//   $JOB         id of a job
//   $BACKUP      name of a backup
//   $ADMIN_KEY   a key of scope admin
//   $KEY_ID      id of another key
#pragma once

#include <set>
#include <string>
#include <vector>

#include "server/http/json.h"
#include "server/http/router.h"

namespace pliant::server {

Json OpenApiDocument(const std::vector<Route>& routes);

// Its components/schemas.
Json OpenApiSchemas();

// The problem codes of a route: its own codes, and the codes that follow from its declaration.
std::set<std::string> RouteCodes(const Route& route);

}  // namespace pliant::server
