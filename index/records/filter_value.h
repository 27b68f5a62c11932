// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Values of filters and of metadata. Private to records/.
#pragma once

#include <optional>

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

inline bool IsFilterNumber(const FilterValue& value) {
  return std::holds_alternative<double>(value) || std::holds_alternative<std::int64_t>(value) ||
         std::holds_alternative<std::uint64_t>(value);
}

}  // namespace pliant
