// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/access.h"

#include <sys/stat.h>

#include "descriptor/base/error.h"
#include "descriptor/base/format_bytes.h"
#include "index/files/durable_file.h"

namespace pliant {

void Access::BeginWriting(std::function<void()> after_commit) {
  WithDatabaseErrors(path_, [&] {
    writer_ = std::make_unique<WriteQueue>(
        std::make_unique<Connection>(path_, Connection::Mode::kReadWrite, busy_timeout_ms_),
        std::move(after_commit));
  });
}

void Access::Write(WriteQueue::Work work, const WriteOptions& options) {
  if (!writer_) {
    throw Error(ErrorCode::kReadOnly, "read_only",
                "the database " + DisplayPath(path_) + " is open for reading only");
  }
  CheckInPlace();
  WithDatabaseErrors(path_, [&] {
    writer_->Run(
        [&](Connection& db) {
          work(db);
          CheckInPlace();  // again, as near to the commit as can be
        },
        options);
  });
}

Access::File Access::FileAt(const std::filesystem::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return {};
  return {status.st_dev, status.st_ino};
}

void Access::CheckInPlace() const {
  if (FileAt(path_) == file_) return;
  throw Error(ErrorCode::kCorrupt, "database_moved",
              "the database " + DisplayPath(path_) +
                  " was removed, renamed or replaced while it was in use; nothing more is written. "
                  "Stop the program, put the right file there, and start it again");
}

void Access::RequireSpace(std::uint64_t bytes, const std::filesystem::path& directory) const {
  const std::filesystem::path where =
      directory.empty() ? std::filesystem::absolute(path_).parent_path() : directory;
  std::error_code unknown;  // then the write itself will tell
  const std::filesystem::space_info space = std::filesystem::space(where, unknown);
  if (unknown || space.available >= bytes + reserve_bytes_) return;
  throw Error(ErrorCode::kNoSpace, "no_space",
              "only " + FormatBytes(space.available) + " are free on the disk of " +
                  DisplayPath(where) + ", and " + FormatBytes(reserve_bytes_) +
                  " are kept for removing pictures; nothing was stored. Remove pictures, or "
                  "give it more space");
}

void Access::WriteAlone(const std::function<void(Connection& db)>& work) {
  CheckInPlace();
  WithDatabaseErrors(path_, [&] {
    Connection db(path_, Connection::Mode::kReadWrite, busy_timeout_ms_);
    SQLite::Transaction transaction(db.database(), SQLite::TransactionBehavior::IMMEDIATE);
    work(db);
    transaction.commit();
  });
}

}  // namespace pliant
