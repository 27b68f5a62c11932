// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Databases that are not files: "postgresql://user@host/database".
#pragma once

#include <filesystem>
#include <string_view>

namespace pliant {

bool IsDatabaseUrl(std::string_view database);

// The directory for a server's temporary files: that of the database's file; for a URL, the
// system's.
std::filesystem::path FolderOf(const std::filesystem::path& database);

// Throws kInvalidArgument "database_unnamed" for an empty name and "database_file_needed" for a
// URL. Write ./NAME for a file of such a name.
void RequireDatabaseFile(const std::filesystem::path& path);

}  // namespace pliant
