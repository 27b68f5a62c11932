// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A database in one file.
#include <mutex>

#include <sqlite3.h>
#include <sys/stat.h>

#include "descriptor/base/error.h"
#include "index/files/durable_file.h"
#include "index/files/process_lock.h"
#include "index/store/database_url.h"
#include "index/store/refusals.h"
#include "index/store/sql/access.h"
#include "index/store/sqlite/database.h"
#include "index/store/sqlite/integrity.h"
#include "index/store/sqlite/new_database.h"
#include "index/store/sqlite/sqlite_connection.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

std::uint64_t SizeOf(const fs::path& path) {
  std::error_code error;  // side files come and go
  const std::uintmax_t size = fs::file_size(path, error);
  return error ? 0 : size;
}

class SqliteAccess : public Access {
 public:
  explicit SqliteAccess(const StoreOptions& options)
      : path_(options.database),
        name_(path_.string()),
        busy_timeout_ms_(options.busy_timeout_ms),
        reserve_bytes_(options.reserve_bytes),
        file_(FileAt(path_)),
        readers_({.open = [this] { return Open(SqliteConnection::Mode::kReadOnly); }}),
        watch_(Guarded([&] { return Open(SqliteConnection::Mode::kReadOnly); })) {}

  const std::string& name() const override { return name_; }
  std::string Identity() override { return fs::weakly_canonical(fs::absolute(path_)).string(); }

  std::unique_ptr<ReadTransaction> BeginReading() override {
    CheckInPlace();
    return std::make_unique<ReadTransaction>(&readers_);
  }

  std::int64_t Version() override {
    return Guarded([&] {
      const std::lock_guard lock(watch_mutex_);
      return watch_->Scalar("PRAGMA data_version");
    });
  }
  FeedPosition Position(Connection& db) override {
    auto& file = static_cast<SqliteConnection&>(db);
    return {file.LastKey("images"), file.LastKey("removals")};
  }

  void RequireSpace(std::uint64_t bytes, const fs::path& directory) const override;
  std::uint64_t SizeBytes() override { return SizeOf(path_) + SizeOf(path_.string() + "-wal"); }
  bool CheckStructure(Connection& db, std::vector<std::string>* problems) override {
    return pliant::CheckStructure(static_cast<SqliteConnection&>(db), problems);
  }
  void Backup(const fs::path& target, const std::stop_token& stop) override {
    const auto copy = [&] {
      // A connection of its own: a backup may take long and must not see its source written by the
      // same connection.
      BackupDatabase(*Open(SqliteConnection::Mode::kReadOnly), target, stop);
    };
    WithDatabaseErrors(path_, copy, target);
  }

  const std::string& Owner() override {
    const std::lock_guard lock(lock_mutex_);
    if (!lock_) lock_.emplace(path_);
    return lock_->id();
  }
  bool Lives(const std::string& owner) override {
    Owner();
    const std::lock_guard lock(lock_mutex_);
    return lock_->IsHeld(owner);
  }

 protected:
  std::unique_ptr<Connection> OpenWriter() override {
    return Open(SqliteConnection::Mode::kReadWrite);
  }
  void BeforeWrite() override { CheckInPlace(); }
  void BeforeCommit() override { CheckInPlace(); }  // again, as near to the commit as can be
  void Reclaim(Connection& db) override;
  void ThrowAsError() override {
    try {
      throw;
    } catch (const SQLite::Exception& error) {
      pliant::ThrowAsError(error, path_);
    }
  }

 private:
  // Device and inode of the database; 0, 0 where there is no file.
  using File = std::pair<std::uint64_t, std::uint64_t>;
  static File FileAt(const fs::path& path) {
    struct stat status = {};
    if (::stat(path.c_str(), &status) != 0) return {};
    return {status.st_dev, status.st_ino};
  }
  // Throws kCorrupt "database_moved" when the file was removed, renamed or replaced since it was
  // opened: what is written to it would be lost, and its log would damage the one in its place.
  void CheckInPlace() const;

  std::unique_ptr<SqliteConnection> Open(SqliteConnection::Mode mode) const {
    return std::make_unique<SqliteConnection>(path_, mode, busy_timeout_ms_);
  }

  const fs::path path_;
  const std::string name_;
  const int busy_timeout_ms_;
  const std::uint64_t reserve_bytes_;
  const File file_;
  // The writer, in the base, is destroyed after them: the last connection to close puts the log
  // into the database and removes it, which only a writing one can.
  ConnectionPool readers_;
  std::mutex watch_mutex_;  // guards watch_
  // data_version tells of commits by other connections than the one that asks: this one never
  // writes, and is never in a transaction, within which the version stands still.
  std::unique_ptr<SqliteConnection> watch_;
  std::mutex lock_mutex_;            // guards lock_
  std::optional<ProcessLock> lock_;  // from the first Owner()
};

void SqliteAccess::CheckInPlace() const {
  if (FileAt(path_) == file_) return;
  throw Error(ErrorCode::kCorrupt, "database_moved",
              "the database " + name_ +
                  " was removed, renamed or replaced while in use; the program stops writing. Stop "
                  "it, restore the file, and start it again");
}

void SqliteAccess::RequireSpace(std::uint64_t bytes, const fs::path& directory) const {
  RequireDiskSpace(directory.empty() ? fs::absolute(path_).parent_path() : directory, bytes,
                   reserve_bytes_);
}

// Freed pages go back to the file system, and the log, which still holds what was deleted, is
// emptied. Both wait for nobody: what another process holds up is done after a later removal.
void SqliteAccess::Reclaim(Connection& db) {
  SQLite::Database& database = static_cast<SqliteConnection&>(db).database();
  const std::int64_t timeout_ms = db.Scalar("PRAGMA busy_timeout");
  database.setBusyTimeout(0);
  if (db.Scalar("PRAGMA freelist_count") > 0) database.tryExec("PRAGMA incremental_vacuum");
  database.tryExec("PRAGMA wal_checkpoint(TRUNCATE)");
  database.setBusyTimeout(static_cast<int>(timeout_ms));
}

// Must not open the file other than through SQLite: closing it would drop the locks that other
// connections of this process hold (POSIX), and another process would take the log away from them.
void RequirePliant(const fs::path& path, int busy_timeout_ms) {
  std::error_code error;
  if (fs::file_size(path, error) == 0 || error) {
    throw Error(ErrorCode::kNotFound, "database_not_found",
                "there is no database " + path.string());
  }
  SqliteConnection db(path, SqliteConnection::Mode::kReadOnly, busy_timeout_ms);
  if (db.Scalar("PRAGMA application_id") == static_cast<std::int64_t>(kApplicationId)) return;
  throw Error(ErrorCode::kCorrupt, "not_a_database",
              path.string() + " is not a Pliant database; it was left untouched");
}

void RequireFile(const StoreOptions& options) {
  const fs::path& file = options.database;
  if (!options.read_only) RemoveAbandoned(file);
  if (InspectDatabaseFile(file) == FileState::kPliant) return;
  if (!options.create || options.read_only) {
    throw Error(ErrorCode::kNotFound, "database_not_found",
                "there is no database " + file.string());
  }
  CreateDatabase(file, options.model_of_new());
}

}  // namespace

std::unique_ptr<Access> OpenFileAccess(const StoreOptions& options, StorePart part) {
  const fs::path& file = options.database;
  RequireDatabaseFile(file);
  WithDatabaseErrors(file, [&] {
    if (part == StorePart::kImages) {
      RequireFile(options);
    } else {
      RequirePliant(file, options.busy_timeout_ms);
    }
    const auto mode =
        options.read_only ? SqliteConnection::Mode::kReadOnly : SqliteConnection::Mode::kReadWrite;
    SqliteConnection db(file, mode, options.busy_timeout_ms);
    refusals::CheckSchemaVersion(file.string(), db.Scalar("PRAGMA user_version"));
  });
  return std::make_unique<SqliteAccess>(options);
}

}  // namespace pliant
