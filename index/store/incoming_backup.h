// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A backup that comes from elsewhere, piece by piece.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>

namespace pliant {

// Until it is published it is a temporary file beside its place, which RemoveAbandonedBackups knows
// and which is gone with the object. Used by one thread at a time.
class IncomingBackup {
 public:
  IncomingBackup() = default;
  virtual ~IncomingBackup() = default;
  IncomingBackup(const IncomingBackup&) = delete;
  IncomingBackup& operator=(const IncomingBackup&) = delete;

  // Throws kCorrupt "not_a_database" as soon as the first bytes say so, and what a full disk
  // throws, also when less than the reserve would stay free.
  virtual void Append(std::string_view bytes) = 0;

  // Checks the whole (it is a database of Pliant's, of this schema, complete, with no tables,
  // views or triggers but Pliant's, and its pages, keys and counts agree), flushes it and gives it
  // its name. Throws kCorrupt "not_a_database", "other_schema", "foreign_schema",
  // "database_truncated", "database_corrupt" and "check_too_long" (a minute, and one per GiB),
  // kConflict "backup_exists", kCancelled "check_stopped".
  virtual void Publish() = 0;
};

// Throws kConflict "backup_exists", kNotFound "no_such_directory", and what a full disk throws when
// there is no room for `bytes` beside the reserve. `stop` ends the check of the whole.
std::unique_ptr<IncomingBackup> ReceiveBackup(const std::filesystem::path& target,
                                              std::uint64_t bytes, std::uint64_t reserve_bytes,
                                              std::function<bool()> stop);

}  // namespace pliant
