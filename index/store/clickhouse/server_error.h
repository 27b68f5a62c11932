// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What ClickHouse says when it refuses, as Error. Both forms are known,
//   Code: 60, e.displayText() = DB::Exception: Table pliant.x doesn't exist., e.what() = ...  (18)
//   Code: 60. DB::Exception: Table pliant.x does not exist. (UNKNOWN_TABLE) (version 24.3.1.1)
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "descriptor/base/error.h"

namespace pliant::clickhouse {

struct ServerError {
  int code = 0;      // of ClickHouse
  std::string text;  // a sentence, without the decoration
};

// The first error in `text`, which may be the end of an answer; nullopt = there is none.
std::optional<ServerError> FindServerError(std::string_view text);

// kUnavailable "shard_unavailable" (no replica of a shard), "database_unavailable" (busy, without
// Keeper, out of memory), "database_timeout" and "database_login_failed"; kNotFound
// "database_table_missing"; kNoSpace "database_full"; kReadOnly "database_read_only"; kInternal
// "database_error".
Error ToError(const ServerError& error, const std::string& host);

}  // namespace pliant::clickhouse
