// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Databases that are not files: "postgresql://user@host/database".
#pragma once

#include <filesystem>
#include <string_view>

namespace pliant {

bool IsDatabaseUrl(std::string_view database);

// Where a server puts what it needs for a moment: beside the database's file, and for a URL where
// this system keeps temporary files.
std::filesystem::path FolderOf(const std::filesystem::path& database);

// Throws kInvalidArgument "database_unnamed" for an empty name and "database_file_needed" for a
// URL. A file of such a name can be given as ./NAME.
void RequireDatabaseFile(const std::filesystem::path& path);

}  // namespace pliant
