// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// JSON that comes in, with its limits; index/json makes what goes out.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "index/json/json.h"

namespace pliant::server {

// Deeper documents are refused: writing one out again recurses once per level.
inline constexpr int kMaxJsonDepth = 32;
// More names in one object are refused: Json looks a name up among all of them, so that reading an
// object takes a time that grows with the square of their number.
inline constexpr std::size_t kMaxJsonNames = 1000;

// Parses a document whose top is an object. Throws ProblemError "invalid_json" naming what is
// wrong with `name`: it does not parse, is not an object, is nested deeper than kMaxJsonDepth, or
// one of its objects has more names than kMaxJsonNames, or one twice.
Json ParseJsonObject(const std::string& text, const std::string& name);
// The same for an array.
Json ParseJsonArray(const std::string& text, const std::string& name);

std::string Base64(const void* data, std::size_t bytes);

// RFC 4648 section 4, with or without padding; a "data:...;base64," before it is taken off. False
// when the text is anything else.
bool Base64Decode(std::string_view text, std::vector<std::uint8_t>* bytes);

// RFC 4648 section 5, without padding.
std::string Base64UrlEncode(const std::string& bytes);
// False when the text is not base64url.
bool Base64UrlDecode(const std::string& text, std::string* bytes);

}  // namespace pliant::server
