// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// JSON that comes in, with its limits; index/json makes what goes out.
#pragma once

#include <cstddef>
#include <string>

#include "index/json/json.h"

namespace pliant::server {

// Deeper documents are refused: writing one out again recurses once per level.
inline constexpr int kMaxJsonDepth = 32;
// More names in one object are refused: Json looks a name up among all of them, so that reading an
// object takes a time that grows with the square of their number.
inline constexpr std::size_t kMaxJsonNames = 1000;

// Parses a document whose top is an object, or another `top`. Throws ProblemError "invalid_json"
// naming what is wrong with `name`: it does not parse, has another top, is nested deeper than
// kMaxJsonDepth, or one of its objects has more names than kMaxJsonNames, or one twice.
Json ParseJson(const std::string& text, const std::string& name,
               Json::value_t top = Json::value_t::object);

}  // namespace pliant::server
