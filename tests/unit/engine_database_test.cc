// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Opening, backing up and checking the database.
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>

#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST_F(EngineTest, AnotherModelIsAConflict) {
  Engine{Options()};  // creates the file
  EngineOptions options = Options();
  options.custom_descriptor = nullptr;
  options.descriptor = "orb";
  try {
    Engine engine(options);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.reason(), "model_mismatch");
    EXPECT_THAT(error.what(), HasSubstr("orb"));
    EXPECT_THAT(error.what(), HasSubstr("rootsift"));
  }
  options.descriptor = "";
  EXPECT_EQ(Engine(options).Stats().descriptor, "rootsift") << "empty means the database's own";
}

TEST_F(EngineTest, OpeningWhatIsNotThereOrReadOnly) {
  EngineOptions options = Options();
  options.create = false;
  ExpectError(ErrorCode::kNotFound, "database_not_found", [&] { Engine engine(options); });
  EXPECT_FALSE(std::filesystem::exists(options.database));
  Engine{Options()};  // creates the file
  options.read_only = true;
  Engine engine(options);
  ExpectError(ErrorCode::kReadOnly, "read_only", [&] { Add(engine, RandomPng(1), "x"); });
}

TEST_F(EngineTest, AFullDiskTakesNoImagesButGivesSomeBack) {
  {
    Engine engine(Options());
    AddMany(engine, 2);
  }
  EngineOptions options = Options();
  options.reserve_bytes = std::uint64_t{1} << 60;  // more than any disk has
  Engine engine(options);
  ExpectError(ErrorCode::kNoSpace, "no_space", [&] { Add(engine, RandomPng(9), "x"); });
  EXPECT_EQ(Add(engine, RandomPng(1), "o1", "p1").outcome, AddOutcome::kUnchanged);
  EXPECT_TRUE(engine.Remove("default", "p1"));
  EXPECT_EQ(engine.Stats().images, 1U);
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineTest, AFailureAfterACommitIsLoggedAndStopsWriting) {
  std::vector<std::string> failures;
  EngineOptions options = Options();
  options.warn = [&](const std::string& failure) { failures.push_back(failure); };
  Engine engine(options);
  AddMany(engine, 4);
  Train(engine, 20);
  SQLite::Database db(options.database.string(), SQLite::OPEN_READWRITE);
  db.exec(
      "CREATE TRIGGER spoil AFTER INSERT ON image_words BEGIN "
      "UPDATE image_words SET data = x'00' WHERE key = new.key; END");
  EXPECT_EQ(Add(engine, RandomPng(9), "x", "spoilt").outcome, AddOutcome::kCreated)
      << "it is durable, and reported so";
  ASSERT_EQ(failures.size(), 1U);
  EXPECT_THAT(failures[0], HasSubstr("the index cannot load the latest changes: "));
  ExpectError(ErrorCode::kCorrupt, "blob_corrupt", [&] { Add(engine, RandomPng(10), "x"); });
  ExpectError(ErrorCode::kInternal, "writing_stopped", [&] { engine.Remove("default", "p1"); });
  EXPECT_EQ(failures.size(), 2U);
  EXPECT_EQ(engine.Stats().images, 5U);
  db.exec("DROP TRIGGER spoil; DELETE FROM image_words WHERE data = x'00'");
  EXPECT_EQ(Add(engine, RandomPng(10), "x").outcome, AddOutcome::kCreated);
  EXPECT_EQ(failures.size(), 2U);
}

TEST_F(EngineTest, NamesThatPliantDoesNotStoreAreReported) {
  Engine engine(Options());
  Add(engine, RandomPng(1), "mug");
  std::string metadata = "{\"0\":0";
  for (int i = 1; i < 2000; ++i) metadata += ",\"" + std::to_string(i) + "\":0";
  metadata += '}';
  SQLite::Database db(Options().database.string(), SQLite::OPEN_READWRITE);
  db.exec("UPDATE objects SET name = 'mug\u3164 \u009B31m'");
  SQLite::Statement(db, "UPDATE images SET source = 'mug\uFE0F.png', metadata = '" + metadata + "'")
      .exec();
  EXPECT_EQ(engine.Check().size(), 3U) << "object, source and metadata";
}

// What was acknowledged would be gone with the file, or be written into a stranger's.
TEST_F(EngineTest, ADatabaseThatIsMovedAwayIsWrittenNoMore) {
  const std::filesystem::path elsewhere = folder_ / "elsewhere.db";
  Engine engine(Options());
  AddMany(engine, 2);
  std::filesystem::rename(Options().database, elsewhere);
  const auto expect_refusals = [&] {
    ExpectError(ErrorCode::kCorrupt, "database_moved", [&] { Add(engine, RandomPng(9), "x"); });
    ExpectError(ErrorCode::kCorrupt, "database_moved", [&] { engine.Remove("default", "p1"); });
    ExpectError(ErrorCode::kCorrupt, "database_moved", [&] { engine.ListCollections(); });
  };
  expect_refusals();
  {
    EngineOptions other = Options();
    other.database = folder_ / "other.db";
    Engine stranger(other);
    AddMany(stranger, 3);
  }
  std::filesystem::copy_file(folder_ / "other.db", Options().database);
  expect_refusals();
  std::filesystem::rename(elsewhere, Options().database);
  EXPECT_EQ(Add(engine, RandomPng(9), "x").outcome, AddOutcome::kCreated);
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineTest, ABackupIsADatabase) {
  Engine engine(Options());
  AddMany(engine, 4);
  Train(engine, 30);
  engine.Backup(folder_ / "copy.db");
  EngineOptions options = Options();
  options.database = folder_ / "copy.db";
  Engine copy(options);
  EXPECT_EQ(copy.Search(RandomPng(2), ByImage()).hits[0].image_id, "p2");
  EXPECT_THAT(copy.Check(), IsEmpty());
  ExpectError(ErrorCode::kConflict, "backup_exists", [&] { engine.Backup(folder_ / "copy.db"); });
}

// Each statement breaks one invariant behind the engine's back; Check must say something.
TEST_F(EngineTest, CheckFindsWhatIsBroken) {
  {
    Engine engine(Options());
    AddMany(engine, 4);
    Train(engine, 30);
    ASSERT_THAT(engine.Check(), IsEmpty());
  }
  const std::filesystem::path good = folder_ / "a.db";
  ASSERT_FALSE(std::filesystem::exists(good.string() + "-wal")) << "closing leaves one file";
  for (const std::string sql : {
           "UPDATE features SET data = zeroblob(length(data)) WHERE image = 1",
           "DELETE FROM features WHERE image = 1",
           "UPDATE images SET keypoints = keypoints + 1 WHERE key = 1",
           "UPDATE images SET width = 1 WHERE key = 1",
           "DELETE FROM image_words WHERE image = 2",
           "UPDATE image_words SET data = (SELECT data FROM image_words WHERE image = 2) "
           "WHERE image = 1",
           "UPDATE image_words SET data = x'00' WHERE image = 1",
           "DELETE FROM vocabulary_words WHERE word = 7",
           "UPDATE vocabulary_words SET data = zeroblob(512) WHERE word = 7",
           "UPDATE vocabularies SET codebook = x'00'",
           "UPDATE vocabularies SET words = 3",
           "UPDATE vocabularies SET ready = 0",
           "UPDATE originals SET data = x'00' WHERE image = 1",
           "INSERT INTO objects (collection, name, natural_name) VALUES (1, 'lonely', 'lonely')",
           "UPDATE features SET model = 99 WHERE image = 1",
           "UPDATE images SET metadata = '[1]' WHERE key = 1",
           "UPDATE images SET id = 'a b' WHERE key = 1",
           "UPDATE objects SET name = char(10) WHERE key = 1",
           "INSERT INTO removals (image) VALUES (1)",
           "UPDATE sqlite_sequence SET seq = 0 WHERE name = 'images'",
           "UPDATE collections SET name = 'other'",
           "PRAGMA user_version = 0",
       }) {
    const std::filesystem::path broken = folder_ / "broken.db";
    for (const char* suffix : {"", "-wal", "-shm"})
      std::filesystem::remove(broken.string() + suffix);
    std::filesystem::copy_file(good, broken);
    EngineOptions options = Options();
    options.database = broken;
    std::vector<std::string> problems;
    try {
      Engine engine(options);  // opened while sound: a server that runs as the damage happens
      SQLite::Database(broken.string(), SQLite::OPEN_READWRITE).exec(sql);
      problems = engine.Check();
    } catch (const Error& error) {
      problems.emplace_back(error.what());
    }
    EXPECT_FALSE(problems.empty()) << sql;
  }
}

TEST_F(EngineTest, DamagedPagesNeverCrash) {
  {
    Engine engine(Options());
    AddMany(engine, 3);
    Train(engine, 20);
  }
  const std::vector<std::uint8_t> good = ReadBytes(folder_ / "a.db");
  std::mt19937_64 random(17);
  int noticed = 0;
  constexpr int kRounds = 25;
  for (int round = 0; round < kRounds; ++round) {
    SCOPED_TRACE(round);
    std::vector<std::uint8_t> damaged = good;
    for (int i = 0; i < 200; ++i) {
      damaged[100 + random() % (damaged.size() - 100)] = static_cast<std::uint8_t>(random());
    }
    const auto file = folder_ / "damaged.db";
    for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(file.string() + suffix);
    WriteBytes(file, damaged);
    EngineOptions options = Options();
    options.database = file;
    try {
      Engine engine(options);
      noticed += engine.Check().empty() ? 0 : 1;
    } catch (const Error&) {
      ++noticed;
    }
  }
  EXPECT_EQ(noticed, kRounds);
}

}  // namespace
}  // namespace pliant::testing
