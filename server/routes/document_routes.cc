// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The OpenAPI document.
#include <memory>

#include "server/openapi/document.h"
#include "server/routes/common.h"
#include "server/routes/routes.h"

namespace pliant::server {

void AddDocumentRoute(std::vector<Route>& routes) {
  const auto text = std::make_shared<std::string>();
  routes.push_back(
      {.name = "openapi",
       .method = "GET",
       .pattern = "/v1/openapi.json",
       .summary = "This document",
       .scope = Scope::kPublic,
       .answers = {{200, "an OpenAPI 3.1 document"}},
       .example = R"(curl "$PLIANT/v1/openapi.json")",
       .handler = [text](const Request&, const Parameters&) { return JsonTextResponse(*text); },
       .needs_index = false});
  *text = ToText(OpenApiDocument(routes));  // with this route
}

}  // namespace pliant::server
