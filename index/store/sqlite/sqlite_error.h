// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// SQLite's errors as Pliant's. Private to index/.
#pragma once

#include <filesystem>

#include <SQLiteCpp/Exception.h>

namespace pliant {

// Throws the Error that stands for `error`; the message names the database file.
[[noreturn]] void ThrowAsError(const SQLite::Exception& error,
                               const std::filesystem::path& database);

// Runs `work` and lets out only Error (and what is no database error at all).
template <typename Work>
auto WithDatabaseErrors(const std::filesystem::path& database, Work&& work) {
  try {
    return work();
  } catch (const SQLite::Exception& error) {
    ThrowAsError(error, database);
  }
}

}  // namespace pliant
