// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// JSON out: what the command line prints and the server sends is made of these. Not a public
// header: the library's own stay free of the JSON library.
#pragma once

#include <cstdint>
#include <string>

#include <nlohmann/json.hpp>

namespace pliant {

// Keys keep the order in which they were written.
using Json = nlohmann::ordered_json;

// On one line. Text that came from outside may hold bytes that are not UTF-8; they are written as
// U+FFFD, so that nothing is thrown.
std::string ToText(const Json& json);

// "2026-01-31T12:00:00.123Z"
std::string IsoTime(std::int64_t unix_ms);

// null for empty text.
Json TextOrNull(const std::string& text);

}  // namespace pliant
