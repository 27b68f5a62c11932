// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Backups from elsewhere: what their schema may be, and that looking at them ends.
#include "index/store/incoming_backup.h"

#include <array>
#include <string>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "index/store/open_store.h"
#include "index/store/sqlite/database.h"
#include "index/store/sqlite/sqlite_connection.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_pictures.h"

namespace pliant {
namespace {

using testing::ExpectError;
using testing::ReadBytes;
using testing::TemporaryFolder;

const DescriptorInfo kModel{"fake", DescriptorKind::kFloat, 8, "fake:1"};
constexpr const char* kEndless =
    "WITH RECURSIVE n (key) AS (SELECT 1 UNION ALL SELECT key + 1 FROM n) ";

// What somebody else may have made of a database, each alone.
const std::array<std::string, 8> kForeign = {
    std::string("DROP TABLE pictures; CREATE VIEW pictures AS ") + kEndless +
        "SELECT key, 1 AS collection, 1 AS keypoints FROM n",
    std::string("CREATE TRIGGER mine AFTER INSERT ON pictures BEGIN ") +
        "INSERT INTO removals (picture) VALUES (1); END",
    "DROP TRIGGER picture_counted; CREATE TRIGGER picture_counted AFTER INSERT ON pictures BEGIN "
    "DELETE FROM pictures; END",
    "DROP TABLE removals; CREATE TABLE removals (seq INTEGER PRIMARY KEY AUTOINCREMENT, picture "
    "INTEGER NOT NULL, more AS (hex(zeroblob(100000000))))",
    "ALTER TABLE pictures ADD COLUMN more CHECK (length(hex(zeroblob(100000000))) > 1)",
    "DROP TABLE pictures",
    "DROP INDEX pictures_by_object",
    "DROP TRIGGER picture_removed",
};
// What does no harm, but is not Pliant's either.
const std::array<std::string, 4> kAdded = {
    std::string("CREATE VIEW other AS ") + kEndless + "SELECT key FROM n",
    "CREATE TABLE other (x)",
    "CREATE INDEX other ON pictures (hex(id))",
    "CREATE VIRTUAL TABLE other USING fts5(x)",
};

class IncomingBackupTest : public ::testing::Test {
 protected:
  std::filesystem::path Make(const std::string& sql) {
    const std::filesystem::path file = folder_ / "made.db";
    std::filesystem::remove(file);
    CreateDatabase(file, kModel);
    SQLite::Database(file.string(), SQLite::OPEN_READWRITE)
        .exec("PRAGMA journal_mode = DELETE;" + sql);
    return file;
  }
  void Receive(const std::filesystem::path& file, bool stop = false) {
    const std::vector<std::uint8_t> bytes = ReadBytes(file);
    const auto backup =
        ReceiveBackup(folder_ / "received.db", bytes.size(), 0, [=] { return stop; });
    backup->Append({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    backup->Publish();
    EXPECT_EQ(ReadBytes(folder_ / "received.db"), bytes);
    std::filesystem::remove(folder_ / "received.db");
  }

  TemporaryFolder folder_;
};

TEST_F(IncomingBackupTest, OnlyThoseOfThisSchemaAreTaken) {
  EXPECT_NO_THROW(Receive(Make("")));
  EXPECT_NO_THROW(Receive(Make("ANALYZE")));
  EXPECT_NO_THROW(Receive(Make("PRAGMA optimize; VACUUM")));
  const auto file = Make("PRAGMA user_version = 10");
  ExpectError(ErrorCode::kCorrupt, "other_schema", [&] { Receive(file); });
}

TEST_F(IncomingBackupTest, ForeignSchemasAreRefused) {
  for (const std::string& sql : kForeign) {
    SCOPED_TRACE(sql);
    const auto file = Make(sql);
    ExpectError(ErrorCode::kCorrupt, "foreign_schema", [&] { Receive(file); });
    ExpectError(ErrorCode::kCorrupt, "database_corrupt", [&] { CheckDatabaseFile(file); });
    ExpectError(ErrorCode::kCorrupt, "backup_damaged",
                [&] { RestoreDatabase(file, folder_ / "restored.db", false); });
  }
}

TEST_F(IncomingBackupTest, WhatAnOperatorAddedIsLeftAndRestoredButNotTakenFromElsewhere) {
  int restored = 0;
  for (const std::string& sql : kAdded) {
    SCOPED_TRACE(sql);
    const auto file = Make(sql);
    ExpectError(ErrorCode::kCorrupt, "foreign_schema", [&] { Receive(file); });
    EXPECT_NO_THROW(CheckDatabaseFile(file));
    EXPECT_NO_THROW(RestoreDatabase(file, folder_ / (std::to_string(++restored) + ".db"), false));
  }
}

TEST_F(IncomingBackupTest, ACheckCanBeStopped) {
  const auto file = Make("");
  ExpectError(ErrorCode::kCancelled, "check_stopped", [&] { Receive(file, true); });
  SqliteConnection db(file, SqliteConnection::Mode::kReadOnly, 0);
  int looks = 0;
  db.StopWhen([&] { return ++looks == 100; });
  try {
    db.Scalar(std::string(kEndless) + "SELECT count(*) FROM n");
    FAIL() << "it is endless";
  } catch (const SQLite::Exception& error) {
    EXPECT_EQ(error.getErrorCode(), SQLITE_INTERRUPT);
  }
}

}  // namespace
}  // namespace pliant
