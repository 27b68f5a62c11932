// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Values of parameters: what they must be, and what their text means.
#pragma once

#include <charconv>
#include <string>
#include <system_error>
#include <vector>

#include "server/http/json.h"
#include "server/http/route_spec.h"

namespace pliant::server {

// Whole text to number; false for anything left over.
template <typename T>
bool ParseNumber(const std::string& text, T* value) {
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, *value);
  return error == std::errc() && stop == end && !text.empty();
}

// Finite numbers with commas between; empty = something else.
std::vector<double> ParseNumbers(const std::string& text);

// Throws ProblemError "invalid_parameter" for a value of a JSON body of another type.
void RequireType(const Parameter& spec, const Json& value);
// A value of a JSON body as the text that it would be in the query. Throws likewise.
std::string JsonText(const Parameter& spec, const Json& value);

// Throws ProblemError "invalid_parameter" or "invalid_json" for text that the parameter cannot be.
// Of a picture it is not looked at.
void CheckText(const Parameter& spec, const std::string& text);

}  // namespace pliant::server
