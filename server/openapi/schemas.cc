// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What the answers look like (JSON Schema 2020-12). A test holds every answer of the examples
// against these.
#include "server/openapi/document.h"
#include "server/openapi/schema_parts.h"

namespace pliant::server {

Json OpenApiSchemas() {
  Json schemas = Json::object();
  for (const char* part : {kCatalogueSchemas, kSearchSchemas, kServiceSchemas}) {
    schemas.update(Json::parse(part));
  }
  return schemas;
}

}  // namespace pliant::server
