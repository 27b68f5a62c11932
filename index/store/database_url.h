// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The name of a database is a file's path, or the URL of a database on a PostgreSQL server.
#pragma once

#include <filesystem>
#include <string_view>

namespace pliant {

// Whether `database` begins with "postgresql://" or "postgres://".
bool IsDatabaseUrl(std::string_view database);

// Where a program writes temporary files: the directory of the database's file, and for a URL the
// directory that this system has for them.
std::filesystem::path FolderOf(const std::filesystem::path& database);

}  // namespace pliant
