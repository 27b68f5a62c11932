// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/database_url.h"

#include <string>

#include "descriptor/base/error.h"

namespace pliant {

bool IsDatabaseUrl(std::string_view database) {
  return database.starts_with("postgresql://") || database.starts_with("postgres://");
}

std::filesystem::path FolderOf(const std::filesystem::path& database) {
  if (IsDatabaseUrl(database.string())) return std::filesystem::temp_directory_path();
  return std::filesystem::absolute(database).parent_path();
}

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
