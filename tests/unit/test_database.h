// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Where the databases of tests are: files, unless a program says otherwise before its tests run.
#pragma once

#include <filesystem>
#include <functional>

namespace pliant::testing {

// Gives the database that stands for a file: always the same one for the same file.
inline std::function<std::filesystem::path(const std::filesystem::path& file)> database_for_file;

inline std::filesystem::path Database(const std::filesystem::path& file) {
  return database_for_file ? database_for_file(file) : file;
}

}  // namespace pliant::testing
