// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Originals as files of a directory: written, shared, lost, damaged, swept, moved, backed up.
#include <atomic>
#include <fstream>
#include <set>
#include <thread>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/sha256.h"
#include "index/engine.h"
#include "index/original_store.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_pictures.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using testing::ExpectError;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::RandomPng;
using testing::ReadBytes;
using testing::TemporaryFolder;
using testing::WriteText;

class EngineOriginalsTest : public ::testing::Test {
 protected:
  using MaybeDirectory = std::optional<fs::path>;

  EngineOptions Options(const MaybeDirectory& directory) {
    EngineOptions options;
    options.database = db_;
    options.custom_descriptor = descriptor_;
    options.originals_dir = directory;
    options.busy_timeout_ms = 2000;
    return options;
  }
  // As `pliant db` opens it.
  EngineOptions Looking(const fs::path& database) {
    EngineOptions options;
    options.database = database;
    options.descriptor.clear();
    options.create = false;
    options.load_descriptor = false;
    options.load_index = false;
    return options;
  }
  static AddResult Add(Engine& engine, std::uint64_t seed, const std::string& id,
                       const std::string& collection = "default") {
    const auto png = RandomPng(seed);
    AddRequest request;
    request.bytes = png;
    request.id = id;
    request.collection = collection;
    return engine.Add(request);
  }
  fs::path FileOf(std::uint64_t seed) const {
    const std::string sha256 = Sha256Hex(RandomPng(seed));
    return directory_ / sha256.substr(0, 2) / sha256;
  }
  // Published files and those that are being written, without the owner's.
  std::size_t Files() const {
    std::size_t files = 0;
    for (const auto& entry : fs::recursive_directory_iterator(directory_)) {
      files += entry.is_regular_file() && entry.path().filename() != "pliant-originals" ? 1 : 0;
    }
    return files;
  }
  std::int64_t BytesInDatabase() {
    return SQLite::Database(db_.string(), SQLite::OPEN_READONLY)
        .execAndGet("SELECT coalesce(sum(length(data)), 0) FROM originals")
        .getInt64();
  }

  TemporaryFolder folder_;
  fs::path db_ = folder_ / "a.db";
  fs::path directory_ = folder_ / "originals";
  std::shared_ptr<const Descriptor> descriptor_ = MakeDescriptor("rootsift");
};

TEST_F(EngineOriginalsTest, AreFilesNamedByTheirHash) {
  Engine engine(Options(directory_));
  Add(engine, 1, "one");
  EXPECT_EQ(ReadBytes(FileOf(1)), RandomPng(1));
  EXPECT_EQ(engine.GetContent("default", "one"), RandomPng(1));
  EXPECT_EQ(BytesInDatabase(), 0);
  EXPECT_EQ(Files(), 1U) << "nothing stays in incoming";
  const auto described = engine.DescribeOriginals();
  ASSERT_TRUE(described);
  EXPECT_EQ(described->directory, directory_);
  EXPECT_EQ(described->files, 1U);
  EXPECT_TRUE(described->owned);
  EXPECT_THAT(engine.Check(), IsEmpty());
  EXPECT_TRUE(engine.Remove("default", "one"));
  EXPECT_EQ(Files(), 0U);
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineOriginalsTest, AFileGoesWithTheLastPictureThatHasIt) {
  Engine engine(Options(directory_));
  engine.CreateCollection("other");
  Add(engine, 1, "a");
  Add(engine, 1, "b");
  Add(engine, 1, "c", "other");
  EXPECT_EQ(Files(), 1U);
  engine.Remove("default", "a");
  EXPECT_EQ(Add(engine, 2, "b").outcome, AddOutcome::kReplaced);
  EXPECT_EQ(Files(), 2U) << "the other collection still has the first";
  EXPECT_EQ(engine.GetContent("other", "c"), RandomPng(1));
  engine.RemoveCollection("other");
  EXPECT_FALSE(fs::exists(FileOf(1)));
  AddRequest named;
  const auto png = RandomPng(3);
  named.bytes = png;
  named.object = "cup";
  engine.Add(named);
  EXPECT_EQ(engine.RemoveObject("default", "cup"), 1U);
  EXPECT_FALSE(fs::exists(FileOf(3)));
  EXPECT_EQ(Add(engine, 4, "b").outcome, AddOutcome::kReplaced);
  EXPECT_FALSE(fs::exists(FileOf(2))) << "a replaced picture leaves nothing";
  EXPECT_EQ(Files(), 1U);
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineOriginalsTest, ALostFileIsSaidAndComesBackWithThePicture) {
  Engine engine(Options(directory_));
  Add(engine, 1, "one");
  fs::remove(FileOf(1));
  ExpectError(ErrorCode::kCorrupt, "original_missing",
              [&] { engine.GetContent("default", "one"); });
  EXPECT_THAT(engine.Check(), ElementsAre(HasSubstr("\"one\"")));
  EXPECT_EQ(Add(engine, 1, "one").outcome, AddOutcome::kUnchanged);
  EXPECT_EQ(engine.GetContent("default", "one"), RandomPng(1));
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineOriginalsTest, ADamagedFileIsNeverServed) {
  Engine engine(Options(directory_));
  engine.CreateCollection("other");
  Add(engine, 1, "one");
  std::vector<std::uint8_t> bytes = ReadBytes(FileOf(1));
  bytes[bytes.size() / 2] ^= 1;
  for (const auto& damaged :
       {bytes, std::vector<std::uint8_t>(bytes.begin(), bytes.begin() + 10),
        std::vector<std::uint8_t>(bytes.size() * 2, 7), std::vector<std::uint8_t>()}) {
    testing::WriteBytes(FileOf(1), damaged);
    ExpectError(ErrorCode::kCorrupt, "original_corrupt",
                [&] { engine.GetContent("default", "one"); });
    EXPECT_THAT(engine.Check(), ElementsAre(HasSubstr("\"one\"")));
  }
  Add(engine, 1, "two", "other");  // the same bytes, whole, for another picture
  EXPECT_EQ(engine.GetContent("default", "one"), RandomPng(1));
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineOriginalsTest, TheOptionIsRememberedAndCanBeSwitched) {
  {
    Engine engine(Options({}));  // a new database without a directory
    Add(engine, 1, "inside");
    EXPECT_FALSE(engine.DescribeOriginals());
  }
  const std::int64_t inside = BytesInDatabase();
  EXPECT_GT(inside, 0);
  {
    Engine engine(Options(directory_));
    Add(engine, 2, "outside");
    EXPECT_EQ(engine.GetContent("default", "inside"), RandomPng(1));
  }
  {
    Engine engine(Options({}));  // remembers
    Add(engine, 3, "outside-too");
    EXPECT_EQ(BytesInDatabase(), inside);
    EXPECT_EQ(Files(), 2U);
  }
  {
    Engine engine(Options(fs::path()));  // back into the database
    Add(engine, 4, "inside-again");
    EXPECT_GT(BytesInDatabase(), inside);
    EXPECT_EQ(Files(), 2U);
    EXPECT_TRUE(engine.Remove("default", "outside"));
    EXPECT_EQ(Files(), 1U);
    EXPECT_EQ(engine.GetContent("default", "outside-too"), RandomPng(3));
    EXPECT_THAT(engine.Check(), IsEmpty());
  }
  EngineOptions none = Options({});
  none.keep_originals = false;
  Engine engine(none);
  Add(engine, 5, "nowhere");
  ExpectError(ErrorCode::kNotFound, "content_not_kept",
              [&] { engine.GetContent("default", "nowhere"); });
}

TEST_F(EngineOriginalsTest, WhatIsStoredMovesIntoFilesAndBack) {
  constexpr int kPictures = 11;  // more than a batch
  {
    Engine engine(Options({}));
    engine.CreateCollection("other");
    for (int i = 1; i <= kPictures; ++i) {
      Add(engine, static_cast<std::uint64_t>(i), "p" + std::to_string(i));
    }
    Add(engine, 1, "shared", "other");
    EXPECT_EQ(engine.MoveOriginals({}).moved, 0U) << "they are where they shall be";
  }
  const auto expect_all = [&](Engine& engine) {
    for (int i = 1; i <= kPictures; ++i) {
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
    EXPECT_EQ(moved.moved, kPictures + 1U);
    EXPECT_EQ(moved.left, 0U);
    EXPECT_EQ(share, 1);
    EXPECT_EQ(tool.MoveOriginals(directory_).moved, 0U);
  }
  EXPECT_EQ(BytesInDatabase(), 0);
  EXPECT_EQ(Files(), static_cast<std::size_t>(kPictures)) << "one is shared";
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
  EXPECT_EQ(back.moved, static_cast<std::uint64_t>(kPictures));
  EXPECT_EQ(back.left, 1U);
  testing::WriteBytes(FileOf(3), lost);
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
}

TEST_F(EngineOriginalsTest, ARemovalThatWasCutOffIsFinished) {
  {
    Engine engine(Options(directory_));
    Add(engine, 1, "one");
    Add(engine, 2, "two");
  }
  {  // committed, and killed before the file was removed
    SQLite::Database db(db_.string(), SQLite::OPEN_READWRITE);
    db.exec("PRAGMA foreign_keys = ON; DELETE FROM pictures WHERE id = 'one'");
  }
  EXPECT_TRUE(fs::exists(FileOf(1)));
  Engine tool(Looking(db_));
  EXPECT_THAT(tool.Check(), IsEmpty());
  EXPECT_FALSE(fs::exists(FileOf(1)));
  EXPECT_TRUE(fs::exists(FileOf(2)));
}

TEST_F(EngineOriginalsTest, AFailedAddLeavesNoFile) {
  Engine engine(Options(directory_));
  Add(engine, 1, "one");
  SQLite::Database(db_.string(), SQLite::OPEN_READWRITE)
      .exec(
          "CREATE TRIGGER refuse BEFORE INSERT ON original_files BEGIN SELECT RAISE(ABORT, 'no'); "
          "END");
  ExpectError(ErrorCode::kInternal, "database_error", [&] { Add(engine, 2, "two"); });
  EXPECT_EQ(Files(), 1U);
  EXPECT_EQ(engine.List({}).size(), 1U);
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
    EXPECT_THAT(tool.Check(), IsEmpty()) << "its picture's file is there";
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

// The same few pictures come and go in many threads and two engines: no reference without a file.
TEST_F(EngineOriginalsTest, AddersRemoversAndSweepersAtOnce) {
  Engine one(Options(directory_));
  Engine two(Options(directory_));
  one.CreateCollection("other");
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 4; ++t) {
      threads.emplace_back([&, t] {
        Engine& engine = t % 2 == 0 ? one : two;
        std::mt19937_64 random(static_cast<std::uint64_t>(100 + t));
        for (int i = 0; i < 40; ++i) {
          const std::uint64_t seed = random() % 3;
          const std::string collection = random() % 2 == 0 ? "default" : "other";
          const std::string id = "p" + std::to_string(seed);
          if (random() % 2 == 0) {
            Add(engine, seed, id, collection);
          } else {
            engine.Remove(collection, id);
          }
          if (i % 10 == t) engine.SweepOriginals();
        }
      });
    }
  }
  std::set<std::uint64_t> seeds;
  for (const char* collection : {"default", "other"}) {
    for (std::uint64_t seed = 0; seed < 3; ++seed) {
      try {
        EXPECT_EQ(one.GetContent(collection, "p" + std::to_string(seed)), RandomPng(seed));
        seeds.insert(seed);
      } catch (const Error& error) {
        EXPECT_EQ(error.reason(), "image_not_found");
      }
    }
  }
  EXPECT_EQ(Files(), seeds.size());
  EXPECT_THAT(one.Check(), IsEmpty());
}

}  // namespace
}  // namespace pliant
