// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/json/json.h"

#include <array>
#include <cstdio>

#include "descriptor/base/unix_time.h"

namespace pliant {

std::string ToText(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string IsoTime(std::int64_t unix_ms) {
  const auto ms = static_cast<int>((unix_ms % 1000 + 1000) % 1000);
  std::array<char, 8> fraction{};
  std::snprintf(fraction.data(), fraction.size(), ".%03dZ", ms);
  return FormatUtc(unix_ms, "%Y-%m-%dT%H:%M:%S") + fraction.data();
}

Json TextOrNull(const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); }

}  // namespace pliant
