// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// New database files, until they get their names. Private to index/.
#pragma once

#include <filesystem>

#include "index/files/durable_file.h"

namespace pliant {

// A new database: an empty file that only its owner can read, because a database contains people's
// images. (To let others read it, change its mode afterwards; SQLite's side files follow.) It is
// locked by flock(), which SQLite does not use: without a lock, its process was killed. Removed
// with its side files unless it was published.
class NewDatabaseFile {
 public:
  // Throws what ThrowErrno throws.
  explicit NewDatabaseFile(const std::filesystem::path& beside);
  ~NewDatabaseFile();
  NewDatabaseFile(const NewDatabaseFile&) = delete;
  NewDatabaseFile& operator=(const NewDatabaseFile&) = delete;

  const std::filesystem::path& path() const { return path_; }

  enum class Over { kNothing, kEmptyFile, kAnything };

  // Flushes it and gives it its name unless a file has the name that `over` does not allow to
  // replace; then false. After an exception with kNothing, no file has that name. No connection to
  // it must be open: closing the lock releases all locks of SQLite.
  bool Publish(const std::filesystem::path& name, Over over);

 private:
  std::filesystem::path path_;
  FileHandle file_;
};

// Removes the new databases of killed processes beside `database`, of that name. Those of living
// processes are locked and stay.
void RemoveAbandoned(const std::filesystem::path& database);

}  // namespace pliant
