// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The part of JSON Schema 2020-12 that the OpenAPI document uses, read strictly: a property that
// the schema does not list is a difference, unless it says additionalProperties.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace pliant::testing {

// Where `value` differs from `schema`; empty = nowhere. `document` is where references lead.
std::vector<std::string> SchemaDifferences(const nlohmann::json& document,
                                           const nlohmann::json& schema,
                                           const nlohmann::json& value);

}  // namespace pliant::testing
