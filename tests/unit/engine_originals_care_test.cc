// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Directories of originals looked after: moved, swept, copied, backed up.
#include <atomic>
#include <thread>
#include <vector>

#include <gmock/gmock.h>

#include "index/store/sql/original_store.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/originals_fixture.h"

namespace pliant::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::IsEmpty;

TEST_F(EngineOriginalsTest, WhatIsStoredMovesIntoFilesAndBack) {
  constexpr int kImages = 11;  // more than a batch
  {
    Engine engine(Options({}));
    engine.CreateCollection("other");
    for (int i = 1; i <= kImages; ++i) {
      Add(engine, static_cast<std::uint64_t>(i), "p" + std::to_string(i));
    }
    Add(engine, 1, "shared", "other");
    EXPECT_EQ(engine.MoveOriginals({}).moved, 0U) << "they are where they shall be";
  }
  const auto expect_all = [&](Engine& engine) {
    for (int i = 1; i <= kImages; ++i) {
      EXPECT_EQ(engine.GetContent("default", "p" + std::to_string(i)),
                RandomPng(static_cast<std::uint64_t>(i)));
    }
    EXPECT_EQ(engine.GetContent("other", "shared"), RandomPng(1));
    EXPECT_THAT(engine.Check(), IsEmpty());
  };
  Engine server(Options({}));  // runs all the time
  {
    Engine tool(Looking(db_));
    double share = 0;
    const auto moved = tool.MoveOriginals(directory_, [&](double done) { share = done; });
    EXPECT_EQ(moved.moved, kImages + 1U);
    EXPECT_EQ(moved.left, 0U);
    EXPECT_EQ(share, 1);
    EXPECT_EQ(tool.MoveOriginals(directory_).moved, 0U);
  }
  EXPECT_EQ(BytesInDatabase(), 0);
  EXPECT_EQ(Files(), static_cast<std::size_t>(kImages)) << "one is shared";
  expect_all(server);
  {
    Engine later(Options({}));
    expect_all(later);
    EXPECT_TRUE(later.DescribeOriginals()->owned);
  }
  const auto lost = ReadBytes(FileOf(3));
  fs::remove(FileOf(3));
  Engine tool(Looking(db_));
  MoveOriginalsResult back = tool.MoveOriginals({});
  EXPECT_EQ(back.moved, static_cast<std::uint64_t>(kImages));
  EXPECT_EQ(back.left, 1U);
  WriteBytes(FileOf(3), lost);
  back = tool.MoveOriginals({});
  EXPECT_EQ(back.moved, 1U);
  EXPECT_EQ(Files(), 0U);
  expect_all(server);
  expect_all(tool);
}

TEST_F(EngineOriginalsTest, AMovedDirectoryIsFoundAndAMissingOneRefused) {
  {
    Engine engine(Options(directory_));
    Add(engine, 1, "one");
  }
  const fs::path elsewhere = folder_ / "elsewhere";
  ExpectError(ErrorCode::kNotFound, "originals_missing", [&] { Engine e(Options(elsewhere)); });
  fs::rename(directory_, elsewhere);
  ExpectError(ErrorCode::kNotFound, "originals_missing", [&] { Engine e(Options({})); });
  fs::create_directory(directory_);  // as a mount point without its disk
  ExpectError(ErrorCode::kNotFound, "originals_missing", [&] { Engine e(Options({})); });
  {
    Engine engine(Options(elsewhere));
    EXPECT_EQ(engine.GetContent("default", "one"), RandomPng(1));
  }
  Engine engine(Options({}));
  EXPECT_EQ(engine.DescribeOriginals()->directory, elsewhere);
  EXPECT_THAT(engine.Check(), IsEmpty());
  ExpectError(ErrorCode::kNotFound, "no_such_directory",
              [&] { Engine e(Options(folder_ / "no" / "where")); });
}

TEST_F(EngineOriginalsTest, WhatADeadProcessLeftIsSweptAndNothingElse) {
  Engine engine(Options(directory_));
  Add(engine, 1, "one");
  const std::string orphan(64, 'e');
  fs::create_directory(directory_ / "ee");
  WriteText(directory_ / "ee" / orphan, "renamed, never committed");
  WriteText(directory_ / "incoming" / "dead", "half a pic");
  const fs::path claim = directory_ / "pliant-originals.part-77";
  WriteText(claim, "an ow");
  EXPECT_EQ(engine.SweepOriginals(), 2U);
  EXPECT_TRUE(fs::exists(claim)) << "it could be of a living process";
  fs::last_write_time(claim, fs::file_time_type::clock::now() - std::chrono::hours(1));
  EXPECT_EQ(engine.SweepOriginals(), 1U);
  WriteText(directory_ / "ee" / orphan, "renamed, never committed");
  WriteText(directory_ / "incoming" / "dead", "half a pic");
  WriteText(directory_ / "ee" / "README", "somebody's");
  WriteText(directory_ / "notes.txt", "somebody's");
  const IncomingOriginal living(directory_, std::string(64, 'f'), RandomPng(9));
  EXPECT_THAT(engine.Check(), IsEmpty()) << "a file too many harms nobody";
  EXPECT_EQ(engine.SweepOriginals(), 2U);
  EXPECT_FALSE(fs::exists(directory_ / "ee" / orphan));
  EXPECT_TRUE(fs::exists(directory_ / "ee" / "README"));
  EXPECT_TRUE(fs::exists(directory_ / "notes.txt"));
  EXPECT_EQ(Files(), 4U) << "one, the two of somebody, and the one that is being written";
  EXPECT_EQ(engine.GetContent("default", "one"), RandomPng(1));
  EXPECT_EQ(engine.SweepOriginals(), 0U);
  fs::rename(directory_, folder_ / "elsewhere");
  ExpectError(ErrorCode::kInternal, "io_error", [&] { engine.SweepOriginals(); });
}

TEST_F(EngineOriginalsTest, WhoOpensToAddImagesRemovesHalfWrittenOnes) {
  {
    Engine made(Options(directory_));
  }
  WriteText(directory_ / "incoming" / "dead", "half a pic");
  {
    EngineOptions reading = Options({});
    reading.read_only = true;
    Engine engine(reading);
  }
  EXPECT_TRUE(fs::exists(directory_ / "incoming" / "dead"));
  Engine engine(Options({}));
  EXPECT_FALSE(fs::exists(directory_ / "incoming" / "dead"));
}

TEST_F(EngineOriginalsTest, ARemovalThatWasCutOffIsFinished) {
  {
    Engine engine(Options(directory_));
    Add(engine, 1, "one");
    Add(engine, 2, "two");
  }
  {  // committed, and killed before the file was removed
    SQLite::Database db(db_.string(), SQLite::OPEN_READWRITE);
    db.exec("PRAGMA foreign_keys = ON; DELETE FROM images WHERE id = 'one'");
  }
  EXPECT_TRUE(fs::exists(FileOf(1)));
  Engine tool(Looking(db_));
  EXPECT_THAT(tool.Check(), IsEmpty());
  EXPECT_FALSE(fs::exists(FileOf(1)));
  EXPECT_TRUE(fs::exists(FileOf(2)));
}

// Whoever is killed, or fails to commit, keeps the old state, and that has its file.
TEST_F(EngineOriginalsTest, AFileIsNotRemovedBeforeTheCommitThatDroppedIt) {
  constexpr int kThreads = 6;
  Engine engine(Options(directory_));
  std::atomic<bool> stop{false};
  std::vector<std::string> missing;
  std::jthread watcher([&] {  // what a process that opens the database now would find
    SQLite::Database db(db_.string(), SQLite::OPEN_READONLY, 2000);
    SQLite::Statement rows(db,
                           "SELECT image, lower(hex(sha256)) FROM original_files ORDER BY image");
    SQLite::Statement still(db, "SELECT count(*) FROM original_files WHERE image = ?");
    while (!stop) {
      std::vector<std::int64_t> gone;
      for (; rows.executeStep();) {
        const std::string sha256 = rows.getColumn(1).getString();
        if (!fs::exists(directory_ / sha256.substr(0, 2) / sha256))
          gone.push_back(rows.getColumn(0));
      }
      rows.reset();
      for (const std::int64_t image : gone) {  // unless its removal was committed meanwhile
        still.bind(1, image);
        still.executeStep();
        if (still.getColumn(0).getInt() != 0) missing.push_back(std::to_string(image));
        still.reset();
      }
    }
  });
  {
    std::vector<std::jthread> threads;
    for (std::uint64_t t = 0; t < kThreads; ++t) {
      threads.emplace_back([&, t] {
        for (std::uint64_t i = 0; i < 25; ++i) Add(engine, 100 * t + i, "p" + std::to_string(t));
      });
    }
  }
  stop = true;
  watcher.join();
  EXPECT_THAT(missing, IsEmpty());
  EXPECT_THAT(engine.Check(), IsEmpty());
  EXPECT_EQ(Files(), std::size_t{kThreads});
}

// What `cp a.db` and a backup are: they name a directory that is not theirs.
TEST_F(EngineOriginalsTest, ACopyOfTheDatabaseTakesNothingFromTheOriginal) {
  const fs::path copy = folder_ / "copy.db";
  Engine engine(Options(directory_));
  Add(engine, 1, "one");
  engine.Backup(copy);
  Add(engine, 2, "two");
  {
    Engine tool(Looking(copy));
    EXPECT_THAT(tool.Check(), IsEmpty()) << "its image's file is there";
    EXPECT_FALSE(tool.DescribeOriginals()->owned);
    EXPECT_EQ(tool.SweepOriginals(), 0U);
    EXPECT_TRUE(tool.Remove("default", "one"));
  }
  EngineOptions other = Options({});
  other.database = copy;
  ExpectError(ErrorCode::kConflict, "originals_foreign", [&] { Engine e(other); });
  other.database = folder_ / "new.db";
  other.originals_dir = directory_;
  ExpectError(ErrorCode::kConflict, "originals_foreign", [&] { Engine e(other); });
  EXPECT_EQ(Files(), 2U);
  EXPECT_THAT(engine.Check(), IsEmpty());
}

// Power went after the directory got its owner and before the database was told.
TEST_F(EngineOriginalsTest, AClaimThatWasCutOffIsMadeAgain) {
  {
    Engine engine(Options({}));
  }
  const std::string owner = std::string(32, 'a') + "\n" + fs::canonical(db_).string() + "\n";
  WriteText(directory_ / "pliant-originals", owner);
  fs::create_directory(directory_ / "incoming");
  {
    Engine engine(Options(directory_));
    Add(engine, 1, "one");
    EXPECT_TRUE(engine.DescribeOriginals()->owned);
  }
  {
    Engine engine(Options({}));
  }
  // With files in it the directory is that of an older database of this name: they are kept.
  for (const char* suffix : {"", "-wal", "-shm"}) fs::remove(db_.string() + suffix);
  ExpectError(ErrorCode::kConflict, "originals_foreign", [&] { Engine e(Options(directory_)); });
  EXPECT_EQ(Files(), 1U);
}

TEST_F(EngineOriginalsTest, ABackupAndACopyOfTheDirectoryAreTheWhole) {
  const fs::path saved = folder_ / "saved";
  fs::create_directory(saved);
  {
    Engine engine(Options(directory_));
    Add(engine, 1, "one");
    Add(engine, 2, "two");
    engine.Backup(saved / "a.db");
    fs::copy(directory_, saved / "originals", fs::copy_options::recursive);
    Add(engine, 3, "later");
    engine.Remove("default", "one");
  }
  EngineOptions looking = Looking(saved / "a.db");
  looking.originals_dir = saved / "originals";
  EXPECT_THAT(Engine(looking).Check(), IsEmpty());
  // Everything is lost and put back.
  fs::remove_all(directory_);
  for (const char* suffix : {"", "-wal", "-shm"}) fs::remove(db_.string() + suffix);
  fs::copy_file(saved / "a.db", db_);
  fs::copy(saved / "originals", directory_, fs::copy_options::recursive);
  Engine engine(Options({}));
  EXPECT_EQ(engine.GetContent("default", "one"), RandomPng(1));
  EXPECT_EQ(engine.GetContent("default", "two"), RandomPng(2));
  EXPECT_THAT(engine.Check(), IsEmpty());
}

}  // namespace
}  // namespace pliant::testing
