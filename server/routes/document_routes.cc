// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The OpenAPI document.
#include <memory>

#include "server/openapi/document.h"
#include "server/routes/changes.h"
#include "server/routes/routes.h"

namespace pliant::server {

void AddDocumentRoute(std::vector<Route>& routes) {
  const auto answer = std::make_shared<Response>();
  routes.push_back({.name = "openapi",
                    .method = "GET",
                    .pattern = "/v1/openapi.json",
                    .summary = "This document",
                    .scope = Scope::kPublic,
                    .answers = {{200, "an OpenAPI 3.1 document, with ETag"},
                                {304, "If-None-Match names its ETag", "", ""}},
                    .example = R"(curl "$PLIANT/v1/openapi.json")",
                    .handler = [answer](const Request&, const Parameters&) { return *answer; },
                    .needs_index = false});
  *answer = TaggedResponse(OpenApiDocument(routes));  // with this route
}

}  // namespace pliant::server
