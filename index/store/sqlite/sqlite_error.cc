// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/sqlite_error.h"

#include <sqlite3.h>

#include "descriptor/base/error.h"
#include "index/files/durable_file.h"

namespace pliant {

void ThrowAsError(const SQLite::Exception& error, const std::filesystem::path& database) {
  const std::string name = "the database " + DisplayPath(database);
  const std::string detail = std::string(" (SQLite: ") + error.what() + ")";
  const int extended = error.getExtendedErrorCode();
  const int kind = error.getErrorCode() & 0xff;
  if ((kind == SQLITE_CANTOPEN || kind == SQLITE_IOERR) && FilesAreUsedUp()) {
    ThrowOutOfFiles(name + " cannot be opened");
  }
  switch (kind) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      throw Error(ErrorCode::kUnavailable, "database_busy",
                  name + " is being written by another process; try again later" + detail);
    case SQLITE_FULL:
      throw Error(ErrorCode::kNoSpace, "disk_full",
                  "no space is left for " + name + "; free some and run again" + detail);
    case SQLITE_READONLY:
    case SQLITE_PERM:
      throw Error(ErrorCode::kReadOnly, "read_only",
                  name + " cannot be written; check its permissions and file system" + detail);
    case SQLITE_CORRUPT:
      throw Error(ErrorCode::kCorrupt, "database_corrupt",
                  name + " is damaged; restore a backup" + detail);
    case SQLITE_NOTADB:
      throw Error(ErrorCode::kCorrupt, "not_a_database",
                  DisplayPath(database) + " is not a Pliant database" + detail);
    case SQLITE_CANTOPEN:
      throw Error(ErrorCode::kNotFound, "cannot_open", name + " cannot be opened" + detail);
    case SQLITE_NOMEM:
      throw Error(ErrorCode::kUnavailable, "out_of_memory",
                  "not enough memory to work on " + name + detail);
    case SQLITE_TOOBIG:
      throw Error(ErrorCode::kTooLarge, "value_too_large", "too large for " + name + detail);
    case SQLITE_IOERR:
      if (extended == SQLITE_IOERR_WRITE || extended == SQLITE_IOERR_FSYNC ||
          extended == SQLITE_IOERR_SHMSIZE || extended == SQLITE_IOERR_TRUNCATE) {
        throw Error(
            ErrorCode::kNoSpace, "write_failed",
            "writing " + name + " failed: disk full, over a file size limit, or failing" + detail);
      }
      throw Error(ErrorCode::kInternal, "io_error",
                  "reading or writing " + name + " failed" + detail);
    default:
      throw Error(ErrorCode::kInternal, "database_error",
                  "an unexpected error of " + name + detail);
  }
}

}  // namespace pliant
