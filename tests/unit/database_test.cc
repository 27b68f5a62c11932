// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The database file: made whole, recognised, refused untouched.
#include "index/store/sqlite/database.h"

#include <thread>

#include <SQLiteCpp/SQLiteCpp.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include "index/store/open_store.h"
#include "index/store/sql/rows.h"
#include "index/store/sqlite/new_database.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_images.h"

namespace pliant {
namespace {

using testing::ExpectError;
using testing::ReadBytes;
using testing::TemporaryFolder;
using testing::WriteBytes;
using testing::WriteText;

const DescriptorInfo kModel{"fake", DescriptorKind::kFloat, 8, "fake:1"};

class DatabaseTest : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "a.db";

  SqliteConnection Open() { return {file_, SqliteConnection::Mode::kReadWrite, 100}; }
  std::size_t FilesInFolder() {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(folder_.path()), {}));
  }
};

// A killed process cannot clean up; what a living one makes is locked and stays.
TEST_F(DatabaseTest, WhatKilledProcessesLeftIsRemoved) {
  const auto old = std::filesystem::file_time_type::clock::now() - std::chrono::hours(1);
  for (const char* name :
       {"a.db.new-12-1", "a.db.new-12-1-wal", "a.db.new-13-7", "a.db.new-13-7-journal",
        "a.db.new-14-2-journal", "a.db.new-x-1", "a.db.new-2024-05-01",
        "a.db.new-14-0123456789abcdef", "a.db.new-", "b.db.new-12-1", "a.db.newer"}) {
    WriteText(folder_ / name, "left");
    std::filesystem::last_write_time(folder_ / name, old);
  }
  WriteText(folder_ / "a.db.new-99-1", "just made");
  const int living = ::open((folder_ / "a.db.new-13-7").c_str(), O_RDONLY);
  ASSERT_EQ(::flock(living, LOCK_EX), 0);
  RemoveAbandoned(file_);
  ::close(living);
  std::vector<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    left.push_back(entry.path().filename().string());
  }
  EXPECT_THAT(left, ::testing::UnorderedElementsAre(
                        "a.db.new-13-7", "a.db.new-13-7-journal", "a.db.new-x-1", "a.db.new-",
                        "b.db.new-12-1", "a.db.newer", "a.db.new-99-1", "a.db.new-2024-05-01"));
}

TEST_F(DatabaseTest, WhatKilledBackupsLeftIsRemoved) {
  const auto old = std::filesystem::file_time_type::clock::now() - std::chrono::hours(1);
  const std::string header("SQLite format 3\0", 16);
  const auto leave = [&](const char* name, const std::string& text) {
    WriteText(folder_ / name, text);
    std::filesystem::last_write_time(folder_ / name, old);
  };
  leave("mon.db.new-12-1", header + "pages");
  leave("mon.db.new-12-1-journal", "pages");
  leave("tue.db.new-12-2", "");
  leave("wed.db.new-12-3", std::string(8192, '\0'));
  leave("letter.new-12-3", "of somebody");
  leave("thu.db", header);
  leave("fri.db.new-13-1", header);
  WriteText(folder_ / "sat.db.new-14-1", header);
  const int living = ::open((folder_ / "fri.db.new-13-1").c_str(), O_RDONLY);
  ASSERT_EQ(::flock(living, LOCK_EX), 0);
  CreateDatabase(file_, kModel);
  SqliteConnection db = Open();
  BackupDatabase(db, folder_ / "sun.db");  // another name than those
  EXPECT_FALSE(std::filesystem::exists(folder_ / "mon.db.new-12-1"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "mon.db.new-12-1-journal"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "tue.db.new-12-2"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "wed.db.new-12-3"));
  for (const char* name : {"letter.new-12-3", "thu.db", "fri.db.new-13-1", "sat.db.new-14-1"}) {
    EXPECT_TRUE(std::filesystem::exists(folder_ / name)) << name;
  }
  ::close(living);
  EXPECT_EQ(RemoveAbandonedBackups(folder_.path()), 1u) << "its process has ended";
  EXPECT_EQ(RemoveAbandonedBackups(folder_ / "missing"), 0u);
}

TEST_F(DatabaseTest, ANewOneIsCompleteAndSetUp) {
  EXPECT_EQ(InspectDatabaseFile(file_), FileState::kAbsent);
  CreateDatabase(file_, kModel);
  EXPECT_EQ(FilesInFolder(), 1u) << "no temporary files stay";
  EXPECT_EQ(InspectDatabaseFile(file_), FileState::kPliant);
  SqliteConnection db = Open();
  using std::filesystem::perms;
  EXPECT_EQ(std::filesystem::status(file_).permissions(), perms::owner_read | perms::owner_write);
  BackupDatabase(db, folder_ / "copy.db");
  EXPECT_EQ(std::filesystem::status(folder_ / "copy.db").permissions(),
            perms::owner_read | perms::owner_write);
  EXPECT_EQ(db.Scalar("PRAGMA application_id"), kApplicationId);
  EXPECT_EQ(db.Scalar("PRAGMA user_version"), 1);
  EXPECT_EQ(db.Scalar("PRAGMA foreign_keys"), 1);
  EXPECT_EQ(db.Scalar("PRAGMA synchronous"), 2);
  EXPECT_EQ(db.Scalar("PRAGMA auto_vacuum"), 2);
  EXPECT_EQ(db.Scalar("PRAGMA secure_delete"), 1);
  EXPECT_EQ(db.Prepare("PRAGMA journal_mode").One().Text(0), "wal");
  EXPECT_EQ(ReadModel(db).model.info.model_id, "fake:1");
  EXPECT_TRUE(FindCollection(db, kDefaultCollection));
}

TEST_F(DatabaseTest, AnEmptyFileCountsAsNew) {
  WriteText(file_, "");
  EXPECT_EQ(InspectDatabaseFile(file_), FileState::kEmpty);
  CreateDatabase(file_, kModel);
  EXPECT_EQ(InspectDatabaseFile(file_), FileState::kPliant);
}

TEST_F(DatabaseTest, AnExistingOneIsNotOverwritten) {
  CreateDatabase(file_, kModel);
  CreateDatabase(file_, {"other", DescriptorKind::kFloat, 8, "other:1"});
  SqliteConnection db = Open();
  EXPECT_EQ(ReadModel(db).model.info.model_id, "fake:1");
}

TEST_F(DatabaseTest, ManyMakersOneDatabase) {
  std::vector<std::jthread> makers;
  for (int i = 0; i < 8; ++i) makers.emplace_back([&] { CreateDatabase(file_, kModel); });
  makers.clear();
  EXPECT_EQ(FilesInFolder(), 1u);
  SqliteConnection db = Open();
  EXPECT_EQ(db.Scalar("SELECT count(*) FROM collections"), 1);
}

TEST_F(DatabaseTest, ForeignFilesAreRefusedAndUntouched) {
  const std::vector<std::string> contents = {"x", "hello, world\n", std::string(5000, 'a'),
                                             std::string("SQLite format 3\0", 16)};
  for (const std::string& content : contents) {
    WriteText(file_, content);
    ExpectError(ErrorCode::kCorrupt, "not_a_database", [&] { InspectDatabaseFile(file_); });
    EXPECT_EQ(ReadBytes(file_), std::vector<std::uint8_t>(content.begin(), content.end()));
  }
  std::filesystem::remove(file_);
  SQLite::Database(file_.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE)
      .exec("CREATE TABLE a (b); PRAGMA user_version = 1");
  const std::vector<std::uint8_t> before = ReadBytes(file_);
  ExpectError(ErrorCode::kCorrupt, "not_a_database", [&] { InspectDatabaseFile(file_); });
  EXPECT_EQ(ReadBytes(file_), before);
  ExpectError(ErrorCode::kCorrupt, "not_a_database", [&] { InspectDatabaseFile(folder_.path()); });
  EXPECT_EQ(FilesInFolder(), 1u);
}

TEST_F(DatabaseTest, TruncatedFilesAreRefused) {
  CreateDatabase(file_, kModel);
  const std::vector<std::uint8_t> whole = ReadBytes(file_);
  for (const std::size_t size :
       {whole.size() - 1, whole.size() / 2, std::size_t{8192}, std::size_t{100}}) {
    WriteBytes(file_, {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)});
    ExpectError(ErrorCode::kCorrupt, "database_truncated", [&] { InspectDatabaseFile(file_); });
  }
}

TEST_F(DatabaseTest, OtherSchemasAreRefusedAndUntouched) {
  for (const int version : {0, 2, 10, 1000}) {
    std::filesystem::remove(file_);
    CreateDatabase(file_, kModel);
    SQLite::Database(file_.string(), SQLite::OPEN_READWRITE)
        .exec("PRAGMA journal_mode = DELETE; PRAGMA user_version = " + std::to_string(version));
    const std::vector<std::uint8_t> before = ReadBytes(file_);
    StoreOptions options;
    options.database = file_;
    for (const bool read_only : {true, false}) {
      options.read_only = read_only;
      try {
        OpenStore(options);
        ADD_FAILURE() << version;
      } catch (const Error& error) {
        EXPECT_EQ(error.reason(), "other_schema");
        EXPECT_THAT(error.what(), ::testing::HasSubstr("has schema " + std::to_string(version) +
                                                       "; this program reads schema 1. Index your "
                                                       "images again with `pliant index`"));
      }
    }
    ExpectError(ErrorCode::kCorrupt, "other_schema", [&] { OpenServiceStore(file_); });
    ExpectError(ErrorCode::kCorrupt, "other_schema",
                [&] { RestoreDatabase(file_, folder_ / "restored.db", false); });
    EXPECT_EQ(ReadBytes(file_), before);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "restored.db"));
  }
}

TEST_F(DatabaseTest, ListsByTimeReadNoMoreThanAPage) {
  CreateDatabase(file_, kModel);
  SqliteConnection db = Open();
  for (const char* column : {"added_ms", "updated_ms"}) {
    SQLite::Statement plan(
        db.database(),
        std::string("EXPLAIN QUERY PLAN SELECT p.id FROM images p JOIN collections c ON "
                    "c.key = p.collection LEFT JOIN objects o ON o.key = p.object "
                    "WHERE p.collection = 1 AND (p.") +
            column + ", p.id) > (5, 'x') ORDER BY p." + column + ", p.id LIMIT 3");
    while (plan.executeStep()) {
      EXPECT_EQ(plan.getColumn(3).getString().find("TEMP B-TREE"), std::string::npos) << column;
    }
  }
}

TEST_F(DatabaseTest, ABackupIsWholeAndNeverOverwrites) {
  CreateDatabase(file_, kModel);
  SqliteConnection db = Open();
  const auto target = folder_ / "backup.db";
  InsertCollection(db, "more", ReadModel(db).key);
  BackupDatabase(db, target);
  SqliteConnection copy(target, SqliteConnection::Mode::kReadOnly, 100);
  EXPECT_TRUE(FindCollection(copy, "more"));
  ExpectError(ErrorCode::kConflict, "backup_exists", [&] { BackupDatabase(db, target); });
  ExpectError(ErrorCode::kConflict, "backup_exists", [&] { BackupDatabase(db, file_); });
  ExpectError(ErrorCode::kNotFound, "no_such_directory",
              [&] { BackupDatabase(db, folder_ / "nowhere" / "backup.db"); });
  std::stop_source stopped;
  stopped.request_stop();
  std::filesystem::create_directory(folder_ / "empty");
  ExpectError(ErrorCode::kCancelled, "cancelled",
              [&] { BackupDatabase(db, folder_ / "empty" / "backup.db", stopped.get_token()); });
  EXPECT_TRUE(std::filesystem::is_empty(folder_ / "empty"));
}

TEST_F(DatabaseTest, ANameThatLooksLikeAUri) {
  const auto odd = folder_ / "file:x.db?mode=memory";
  CreateDatabase(odd, kModel);
  EXPECT_EQ(InspectDatabaseFile(odd), FileState::kPliant);
  EXPECT_TRUE(std::filesystem::exists(odd));
}

TEST_F(DatabaseTest, StatementsComeBackUsable) {
  CreateDatabase(file_, kModel);
  SqliteConnection db = Open();
  constexpr const char* kSql = "SELECT name FROM collections WHERE name = ?";
  Cursor outer = db.Prepare(kSql);
  ASSERT_TRUE(outer.Bind(std::string("default")).Next());
  for (int i = 0; i < 3; ++i) {
    Cursor inner = db.Prepare(kSql);  // the same SQL while it is in use
    EXPECT_FALSE(inner.Next()) << "no binding is left from before";
  }
  EXPECT_EQ(outer.Text(0), "default");
}

}  // namespace
}  // namespace pliant
