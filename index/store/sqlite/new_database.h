// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Database files that are being made, and how they get their names. Private to index/.
#pragma once

#include <filesystem>

#include "index/files/durable_file.h"

namespace pliant {

// A database in the making: an empty file that only its owner may read, because a database holds
// people's images (whoever wants others to read it changes the mode afterwards, and SQLite's side
// files follow). It is locked, by flock(), which SQLite does not use: one that nobody locks is of a
// process that was killed. Removed with its side files unless it has got another name.
class NewDatabaseFile {
 public:
  // Throws what ThrowErrno throws.
  explicit NewDatabaseFile(const std::filesystem::path& beside);
  ~NewDatabaseFile();
  NewDatabaseFile(const NewDatabaseFile&) = delete;
  NewDatabaseFile& operator=(const NewDatabaseFile&) = delete;

  const std::filesystem::path& path() const { return path_; }

  enum class Over { kNothing, kEmptyFile, kAnything };

  // Flushes it and gives it its name unless that is taken by more than `over` says; false = taken.
  // What throws with kNothing leaves no file of that name.
  // No connection may be open on it: closing the lock ends all locks that SQLite holds.
  bool Publish(const std::filesystem::path& name, Over over);

 private:
  std::filesystem::path path_;
  FileHandle file_;
};

// Removes what killed processes have left of databases in the making beside `database`, of that
// name. Those that are being made by living ones are locked and stay.
void RemoveAbandoned(const std::filesystem::path& database);

}  // namespace pliant
