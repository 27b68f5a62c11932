// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/database_file.h"

#include <string>

#include "descriptor/base/error.h"
#include "index/store/database_url.h"

namespace pliant {

void RequireDatabaseFile(const std::filesystem::path& path) {
  if (path.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "database_unnamed",
                "the name of the database is empty");
  }
  if (!IsDatabaseUrl(path.string())) return;
  throw Error(ErrorCode::kInvalidArgument, "database_file_needed",
              "this needs a database file, and the database is on a server; its own tools back it "
              "up and restore it, and `pliant db copy` copies it to a file");
}

}  // namespace pliant
