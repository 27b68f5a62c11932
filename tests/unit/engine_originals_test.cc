// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Originals as files of a directory: written, shared, lost, damaged.
#include <random>
#include <set>
#include <thread>
#include <vector>

#include <gmock/gmock.h>

#include "tests/unit/expect_error.h"
#include "tests/unit/originals_fixture.h"

namespace pliant::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

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

TEST_F(EngineOriginalsTest, AFileGoesWithTheLastImageThatHasIt) {
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
  EXPECT_FALSE(fs::exists(FileOf(2))) << "a replaced image leaves nothing";
  EXPECT_EQ(Files(), 1U);
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineOriginalsTest, ALostFileIsSaidAndComesBackWithTheImage) {
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
    WriteBytes(FileOf(1), damaged);
    ExpectError(ErrorCode::kCorrupt, "original_corrupt",
                [&] { engine.GetContent("default", "one"); });
    EXPECT_THAT(engine.Check(), ElementsAre(HasSubstr("\"one\"")));
  }
  Add(engine, 1, "two", "other");  // the same bytes, whole, for another image
  EXPECT_EQ(engine.GetContent("default", "one"), RandomPng(1));
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineOriginalsTest, DamagedBytesOfTheDatabaseAreNeverServed) {
  {
    Engine engine(Options({}));
    Add(engine, 1, "one");
    EXPECT_EQ(engine.GetContent("default", "one"), RandomPng(1));
  }
  SQLite::Database(db_.string(), SQLite::OPEN_READWRITE)
      .exec(
          "UPDATE originals SET data = CAST(substr(data, 1, 20) || x'55' || substr(data, 22) AS "
          "BLOB)");
  Engine engine(Options({}));
  ExpectError(ErrorCode::kCorrupt, "original_corrupt",
              [&] { engine.GetContent("default", "one"); });
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

TEST_F(EngineOriginalsTest, AFailedAddLeavesNoFile) {
  Engine engine(Options(directory_));
  Add(engine, 1, "one");
  SQLite::Database(db_.string(), SQLite::OPEN_READWRITE)
      .exec(
          "CREATE TRIGGER refuse BEFORE INSERT ON original_files BEGIN SELECT RAISE(ABORT, 'no'); "
          "END");
  ExpectError(ErrorCode::kInternal, "database_error", [&] { Add(engine, 2, "two"); });
  EXPECT_EQ(Files(), 1U);
  EXPECT_EQ(engine.ListPage(ImageListing()).records.size(), 1U);
}

// The same few images come and go in many threads and two engines: no reference without a file.
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
}  // namespace pliant::testing
