// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/database_url.h"

#include <string>

namespace pliant {

bool IsDatabaseUrl(std::string_view database) {
  return database.starts_with("postgresql://") || database.starts_with("postgres://");
}

std::filesystem::path FolderOf(const std::filesystem::path& database) {
  if (IsDatabaseUrl(database.string())) return std::filesystem::temp_directory_path();
  return std::filesystem::absolute(database).parent_path();
}

}  // namespace pliant
