// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace pliant {

// Throws kInvalidArgument "database_unnamed" for an empty name and "database_is_a_cluster" when
// `path` is the URL of one: what keeps pictures keeps them in files today. A file of such a name
// can be given as ./NAME.
void RequireDatabaseFile(const std::filesystem::path& path);

}  // namespace pliant
