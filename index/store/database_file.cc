// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/database_file.h"

#include "descriptor/base/error.h"
#include "index/store/database_url.h"

namespace pliant {

void RequireDatabaseFile(const std::filesystem::path& path) {
  if (path.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "database_unnamed",
                "the name of the database is empty");
  }
  if (!IsDatabaseUrl(path.string())) return;
  throw Error(ErrorCode::kInvalidArgument, "database_is_a_url",
              "the database is the URL of a PostgreSQL database, and this needs a database file; "
              "back up and restore PostgreSQL with its own tools");
}

}  // namespace pliant
