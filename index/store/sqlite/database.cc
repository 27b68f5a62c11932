// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/database.h"

#include <array>
#include <cstring>
#include <fstream>
#include <string>

#include <SQLiteCpp/Backup.h>
#include <SQLiteCpp/Transaction.h>
#include <sqlite3.h>

#include "descriptor/base/error.h"
#include "index/files/durable_file.h"
#include "index/store/open_store.h"
#include "index/store/refusals.h"
#include "index/store/sql/rows.h"
#include "index/store/sql/schema.h"
#include "index/store/sqlite/new_database.h"
#include "index/store/sqlite/sqlite_connection.h"

namespace pliant {
namespace {

// What this database adds to the common tables.
constexpr const char* kOwn = R"sql(
CREATE TABLE removals (
  seq INTEGER PRIMARY KEY AUTOINCREMENT,
  image INTEGER NOT NULL
);
CREATE TRIGGER image_removed AFTER DELETE ON images BEGIN
  INSERT INTO removals (image) VALUES (old.key);
  -- A reader that missed more than these loads everything again.
  DELETE FROM removals WHERE seq <= (SELECT max(seq) FROM removals) - 10000;
END;
CREATE TRIGGER original_dropped AFTER DELETE ON original_files BEGIN
  INSERT OR IGNORE INTO dropped_originals (sha256) VALUES (old.sha256);
END;
CREATE TRIGGER image_counted AFTER INSERT ON images BEGIN
  UPDATE collections SET images = images + 1, descriptors = descriptors + new.keypoints
  WHERE key = new.collection;
END;
CREATE TRIGGER image_uncounted AFTER DELETE ON images BEGIN
  UPDATE collections SET images = images - 1, descriptors = descriptors - old.keypoints
  WHERE key = old.collection;
END;
CREATE TRIGGER object_counted AFTER INSERT ON objects BEGIN
  UPDATE collections SET objects = objects + 1 WHERE key = new.collection;
END;
CREATE TRIGGER object_uncounted AFTER DELETE ON objects BEGIN
  UPDATE collections SET objects = objects - 1 WHERE key = old.collection;
END;
CREATE TRIGGER job_forgotten AFTER DELETE ON jobs BEGIN
  DELETE FROM job_inputs WHERE job = old.id;
  DELETE FROM job_items WHERE job = old.id;
END;
)sql";

namespace fs = std::filesystem;

constexpr int kPagesAtOnce = 1024;         // of a copy, before it may be stopped
constexpr std::size_t kHeaderBytes = 100;  // of an SQLite file
using Header = std::array<unsigned char, kHeaderBytes>;

std::uint32_t BigEndian(const Header& header, std::size_t at, int bytes) {
  std::uint32_t value = 0;
  for (int i = 0; i < bytes; ++i) value = value << 8 | header[at + i];
  return value;
}

[[noreturn]] void ThrowForeign(const fs::path& path, const std::string& why) {
  throw Error(ErrorCode::kCorrupt, "not_a_database",
              path.string() + " is not a Pliant database (" + why +
                  "); it was left untouched: name another file");
}

// A backup is a state, not work in progress: restored, its own job would be an interrupted one.
void RemoveActiveJobs(const fs::path& copy) {
  SQLite::Database database(fs::absolute(copy).string(), SQLite::OPEN_READWRITE);
  SQLite::Transaction writing(database);
  database.exec(R"sql(
    DELETE FROM jobs WHERE state IN ('queued', 'running');
    DELETE FROM job_inputs WHERE job NOT IN (SELECT id FROM jobs);
    DELETE FROM job_items WHERE job NOT IN (SELECT id FROM jobs);
  )sql");
  writing.commit();
  database.exec("PRAGMA wal_checkpoint(TRUNCATE)");
}

}  // namespace

void MakeTables(SQLite::Database& database) {
  SQLite::Transaction transaction(database);
  database.exec(kTables);
  database.exec(kOwn);
  database.exec("PRAGMA user_version = " + std::to_string(kSchemaVersion));
  transaction.commit();
}

FileState InspectDatabaseFile(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::not_found) return FileState::kAbsent;
  if (!fs::is_regular_file(status)) ThrowForeign(path, "it is no regular file");
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    if (FilesAreUsedUp()) ThrowOutOfFiles("the database " + path.string() + " cannot be read");
    throw Error(ErrorCode::kNotFound, "cannot_open",
                "the database " + path.string() + " cannot be read; check its permissions");
  }
  Header header{};
  file.read(reinterpret_cast<char*>(header.data()), header.size());
  const auto got = static_cast<std::size_t>(file.gcount());
  if (got == 0) return FileState::kEmpty;
  if (got < header.size() || std::memcmp(header.data(), "SQLite format 3", 16) != 0) {
    ThrowForeign(path, "its content is of another type");
  }
  if (BigEndian(header, 68, 4) != kApplicationId)
    ThrowForeign(path, "another program's SQLite file");
  const std::uint32_t page = BigEndian(header, 16, 2) == 1 ? 65536 : BigEndian(header, 16, 2);
  const std::uint64_t expected = std::uint64_t{page} * BigEndian(header, 28, 4);
  const fs::path wal = path.string() + "-wal";
  if (fs::file_size(path) < expected && (!fs::exists(wal) || fs::file_size(wal) == 0)) {
    throw Error(ErrorCode::kCorrupt, "database_truncated",
                path.string() + " is cut short (" + std::to_string(fs::file_size(path)) + " of " +
                    std::to_string(expected) + " bytes); restore a backup");
  }
  return FileState::kPliant;
}

void CreateDatabase(const fs::path& path, const DescriptorInfo& model) {
  CheckParentDirectory(path);
  NewDatabaseFile temporary(path);
  {
    SQLite::Database database(fs::absolute(temporary.path()).string(),
                              SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    database.exec("PRAGMA page_size = 8192");
    database.exec("PRAGMA auto_vacuum = INCREMENTAL");
    database.exec("PRAGMA application_id = " + std::to_string(kApplicationId));
    database.exec("PRAGMA journal_mode = WAL");
    MakeTables(database);
  }
  {
    SqliteConnection db(temporary.path(), SqliteConnection::Mode::kReadWrite,
                        /*busy_timeout_ms=*/0);
    db.BeginWrite();
    InsertFirstRows(db, model);
    db.Commit();
    // Closing would do this and keep silent about a failure, and the log does not come along.
    db.Exec("PRAGMA wal_checkpoint(TRUNCATE)");
  }
  temporary.Publish(path, NewDatabaseFile::Over::kEmptyFile);
}

void CopyDatabase(SqliteConnection& source, const fs::path& target, const std::stop_token& stop) {
  SQLite::Database copy(fs::absolute(target).string(),
                        SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  // Held during all steps: otherwise a write by another process would restart the copy.
  const SQLite::Transaction reading(source.database());
  source.Scalar("SELECT count(*) FROM sqlite_schema");
  SQLite::Backup backup(copy, source.database());
  int result = SQLITE_OK;
  while (result == SQLITE_OK) {
    if (stop.stop_requested()) {
      throw Error(ErrorCode::kCancelled, "cancelled", "stopped on request; nothing was written");
    }
    result = backup.executeStep(kPagesAtOnce);
  }
  if (result != SQLITE_DONE) {
    throw SQLite::Exception("the copy could not be finished", SQLITE_BUSY);
  }
}

void BackupDatabase(SqliteConnection& source, const fs::path& target, const std::stop_token& stop) {
  CheckParentDirectory(target);
  const Error exists(ErrorCode::kConflict, "backup_exists",
                     target.string() + " exists already; name a new file for the backup");
  std::error_code ignored;
  if (fs::exists(fs::symlink_status(target, ignored))) {
    SyncDirectoryOf(target);  // of a backup that failed when it was all but done
    throw exists;
  }
  RemoveAbandonedBackups(fs::absolute(target).parent_path());
  NewDatabaseFile temporary(target);
  CopyDatabase(source, temporary.path(), stop);
  RemoveActiveJobs(temporary.path());
  if (!temporary.Publish(target, NewDatabaseFile::Over::kNothing)) throw exists;
}

}  // namespace pliant
