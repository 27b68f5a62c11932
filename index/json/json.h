// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// JSON output of the command line and of the server. Not a public header: public headers do not
// include the JSON library.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

namespace pliant {

// Keys keep the order in which they were written.
using Json = nlohmann::ordered_json;

// On one line. Text from outside can contain invalid UTF-8; it is written as U+FFFD, so that
// nothing is thrown.
std::string ToText(const Json& json);

// "2026-01-31T12:00:00.123Z"
std::string IsoTime(std::int64_t unix_ms);

// null for empty text.
Json TextOrNull(const std::string& text);

template <typename Value>
Json OrNull(const std::optional<Value>& value) {
  return value ? Json(*value) : Json(nullptr);
}

}  // namespace pliant
