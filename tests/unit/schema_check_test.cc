// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What the schema of a database may be.
#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include "index/store/open_store.h"
#include "index/store/sqlite/database.h"
#include "index/store/sqlite/integrity.h"
#include "index/store/sqlite/sqlite_connection.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_images.h"

namespace pliant {
namespace {

using testing::ExpectError;
using testing::TemporaryFolder;

const DescriptorInfo kModel{"fake", DescriptorKind::kFloat, 8, "fake:1"};
constexpr const char* kEndless =
    "WITH RECURSIVE n (key) AS (SELECT 1 UNION ALL SELECT key + 1 FROM n) ";

// What somebody else may have made of a database, each alone.
const std::array<std::string, 8> kForeign = {
    std::string("DROP TABLE images; CREATE VIEW images AS ") + kEndless +
        "SELECT key, 1 AS collection, 1 AS keypoints FROM n",
    std::string("CREATE TRIGGER mine AFTER INSERT ON images BEGIN ") +
        "INSERT INTO removals (image) VALUES (1); END",
    "DROP TRIGGER image_counted; CREATE TRIGGER image_counted AFTER INSERT ON images BEGIN "
    "DELETE FROM images; END",
    "DROP TABLE removals; CREATE TABLE removals (seq INTEGER PRIMARY KEY AUTOINCREMENT, image "
    "INTEGER NOT NULL, more AS (hex(zeroblob(100000000))))",
    "ALTER TABLE images ADD COLUMN more CHECK (length(hex(zeroblob(100000000))) > 1)",
    "DROP TABLE images",
    "DROP INDEX images_by_object",
    "DROP TRIGGER image_removed",
};
// What does no harm, but is not Pliant's either.
const std::array<std::string, 4> kAdded = {
    std::string("CREATE VIEW other AS ") + kEndless + "SELECT key FROM n",
    "CREATE TABLE other (x)",
    "CREATE INDEX other ON images (hex(id))",
    "CREATE VIRTUAL TABLE other USING fts5(x)",
};

class SchemaCheckTest : public ::testing::Test {
 protected:
  std::filesystem::path Make(const std::string& sql) {
    const std::filesystem::path file = folder_ / "made.db";
    std::filesystem::remove(file);
    CreateDatabase(file, kModel);
    SQLite::Database(file.string(), SQLite::OPEN_READWRITE)
        .exec("PRAGMA journal_mode = DELETE;" + sql);
    return file;
  }
  TemporaryFolder folder_;
};

TEST_F(SchemaCheckTest, OwnSchemaPasses) {
  for (const char* sql : {"", "ANALYZE", "PRAGMA optimize; VACUUM"}) {
    EXPECT_NO_THROW(CheckDatabaseFile(Make(sql)));
  }
}

TEST_F(SchemaCheckTest, ForeignSchemasAreRefused) {
  for (const std::string& sql : kForeign) {
    SCOPED_TRACE(sql);
    const auto file = Make(sql);
    ExpectError(ErrorCode::kCorrupt, "database_corrupt", [&] { CheckDatabaseFile(file); });
    ExpectError(ErrorCode::kCorrupt, "backup_damaged",
                [&] { RestoreDatabase(file, folder_ / "restored.db", false); });
  }
}

TEST_F(SchemaCheckTest, AllOfALargeFileIsReadOnlyIfItWasNotClosed) {
  const auto file =
      Make("INSERT INTO collections (name, model, created_ms, images) VALUES ('c', 1, 1, 5)");
  ExpectError(ErrorCode::kCorrupt, "database_corrupt", [&] { CheckDatabaseFile(file); });
  std::filesystem::resize_file(file, std::uintmax_t{3} << 30U);  // the file system stores no zeros
  EXPECT_NO_THROW(CheckDatabaseFile(file));
  std::ofstream(file.string() + "-wal") << "what a stop left behind";
  ExpectError(ErrorCode::kCorrupt, "database_corrupt", [&] { CheckDatabaseFile(file); });
}

TEST_F(SchemaCheckTest, WhatAnOperatorAddedIsLeftAndRestored) {
  int restored = 0;
  for (const std::string& sql : kAdded) {
    SCOPED_TRACE(sql);
    const auto file = Make(sql);
    EXPECT_NO_THROW(CheckDatabaseFile(file));
    EXPECT_NO_THROW(RestoreDatabase(file, folder_ / (std::to_string(++restored) + ".db"), false));
  }
}

}  // namespace
}  // namespace pliant
