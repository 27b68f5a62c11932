// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Values of filters and of metadata. Private to records/ and store/.
#pragma once

#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "index/records/filter.h"

namespace pliant {

// nullopt for a list or an object.
inline std::optional<FilterValue> FilterValueOf(const nlohmann::json& json) {
  if (json.is_null()) return FilterValue(std::monostate{});
  if (json.is_boolean()) return FilterValue(json.get<bool>());
  if (json.is_number_unsigned()) return FilterValue(json.get<std::uint64_t>());
  if (json.is_number_integer()) return FilterValue(json.get<std::int64_t>());
  if (json.is_number()) return FilterValue(json.get<double>());
  if (json.is_string()) return FilterValue(json.get_ref<const std::string&>());
  return std::nullopt;
}

// Without U+0000, which PostgreSQL's JSON cannot have: as its function pliant_escaped writes it
// (store/postgres/schema.cc). Injective, and keeps the order of bytes.
inline std::string EscapedNul(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\0') {
      escaped += "\1\1";
    } else if (c == '\1') {
      escaped += "\1\2";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

inline bool IsFilterNumber(const FilterValue& value) {
  return std::holds_alternative<double>(value) || std::holds_alternative<std::int64_t>(value) ||
         std::holds_alternative<std::uint64_t>(value);
}

}  // namespace pliant
