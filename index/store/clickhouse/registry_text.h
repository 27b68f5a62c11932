// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The bodies of rows of the registry. Private to store/clickhouse.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "index/store/clickhouse/registry.h"

namespace pliant::clickhouse {

inline std::string RegistryText(const nlohmann::json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

inline RegistryRow RegistryGone(const std::string& kind, const std::string& name) {
  return {kind, name, true, "{}"};
}

}  // namespace pliant::clickhouse
