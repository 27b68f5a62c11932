// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace pliant {

// Throws kInvalidArgument "database_unnamed" for an empty name and "database_file_needed" when
// `path` is the URL of a database (database_url.h). A file of such a name can be given as ./NAME.
void RequireDatabaseFile(const std::filesystem::path& path);

}  // namespace pliant
