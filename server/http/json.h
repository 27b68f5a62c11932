// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// JSON in and out: limits on what comes in, never an exception on what goes out.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

namespace pliant::server {

// Keys keep the order in which they were written.
using Json = nlohmann::ordered_json;

// Deeper documents are refused: writing one out again recurses once per level.
inline constexpr int kMaxJsonDepth = 32;

// Parses a document whose top is an object. Throws ProblemError "invalid_json" naming what is
// wrong with `name`: it does not parse, is not an object, or is nested deeper than kMaxJsonDepth.
Json ParseJsonObject(const std::string& text, const std::string& name);
// The same for an array.
Json ParseJsonArray(const std::string& text, const std::string& name);

// Text that came from outside may hold bytes that are not UTF-8; they are written as U+FFFD.
std::string ToText(const Json& json);

std::string Base64(const void* data, std::size_t bytes);

// RFC 4648 section 5, without padding.
std::string Base64UrlEncode(const std::string& bytes);
// False when the text is not base64url.
bool Base64UrlDecode(const std::string& text, std::string* bytes);

// "2026-01-31T12:00:00.123Z"
std::string FormatTime(std::int64_t unix_ms);

}  // namespace pliant::server
