// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The schemas of answers and bodies, as JSON objects by name. Private to openapi/.
#pragma once

namespace pliant::server {

extern const char* const kCatalogueSchemas;
extern const char* const kSearchSchemas;
extern const char* const kServiceSchemas;

}  // namespace pliant::server
