// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant db stats
#pragma once

#include <optional>
#include <string>

#include "index/cli/output.h"
#include "index/engine/engine.h"
#include "index/json/json.h"

namespace pliant::cli {

struct StatsOptions {
  std::string collection;  // empty = all of them
  bool json = false;
};

// Opens the database. Throws kNotFound "collection_not_found".
ExitStatus RunStats(EngineOptions& opened, const StatsOptions& options);

Json OriginalsJson(const std::optional<OriginalsRecord>& originals);

}  // namespace pliant::cli
