// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Tells whether another process that uses a database still lives. Private to index/.
#pragma once

#include <filesystem>
#include <string>

#include "index/files/durable_file.h"

namespace pliant {

// An empty file beside the database, `NAME.server-ID`, that a process holds locked (flock) while it
// lives. The system releases the lock when the process ends in any way. So others need no clock,
// and it works across containers. Links to the database lead to the same file. Removed by the
// destructor; one that a killed process left is removed by the next lock on that database.
class ProcessLock {
 public:
  // Throws what ThrowErrno throws when the directory may not be written.
  explicit ProcessLock(const std::filesystem::path& database);
  ~ProcessLock();
  ProcessLock(const ProcessLock&) = delete;
  ProcessLock& operator=(const ProcessLock&) = delete;

  const std::string& id() const { return id_; }

  // Whether the process with that id lives. If this is unknown, the process counts as living,
  // because its work must not be done twice. It also counts as living if both its file and this
  // process's file are missing.
  bool IsHeld(const std::string& id) const;

 private:
  std::filesystem::path database_;  // without links
  std::string id_;                  // process number and 16 random hex digits
  std::filesystem::path path_;
  FileHandle file_;
};

}  // namespace pliant
