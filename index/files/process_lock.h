// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Whether another process that works on a database still lives. Private to index/.
#pragma once

#include <filesystem>
#include <string>

#include "index/files/durable_file.h"

namespace pliant {

// An empty file beside the database, `NAME.server-ID`, that a process holds locked (flock) while it
// lives. The system ends the lock with the process, however that ends, so others need no clocks to
// tell, and see it through the borders of containers. Links to the database lead to one file.
// Removed by the destructor; one that a killed process left is removed by the next lock on that
// database.
class ProcessLock {
 public:
  // Throws what ThrowErrno throws when the directory may not be written.
  explicit ProcessLock(const std::filesystem::path& database);
  ~ProcessLock();
  ProcessLock(const ProcessLock&) = delete;
  ProcessLock& operator=(const ProcessLock&) = delete;

  const std::string& id() const { return id_; }

  // Whether the process with that id lives. One that cannot be asked counts as living, because what
  // it does must not be done twice; so does one whose file is gone where this one's is gone, too.
  bool IsHeld(const std::string& id) const;

 private:
  std::filesystem::path database_;  // without links
  std::string id_;                  // process number and 16 random hex digits
  std::filesystem::path path_;
  FileHandle file_;
};

}  // namespace pliant
