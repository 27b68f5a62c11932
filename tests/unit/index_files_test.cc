// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The index in files: it is what the database says after any change, and damage is only slow.
#include "index/rank/index_files.h"

#include <filesystem>
#include <fstream>
#include <mutex>
#include <string>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>

#include "index/store/open_store.h"
#include "tests/unit/engine_fixture.h"
#include "tests/unit/index_test_words.h"

namespace pliant::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class IndexFilesTest : public EngineTest {
 protected:
  IndexFilesTest() { Make(6); }

  EngineOptions Saving() {
    EngineOptions options = Options();
    options.save_index_from = 1;
    options.warn = [this](const std::string& warning) {
      const std::lock_guard lock(mutex_);
      warnings_.push_back(warning);
    };
    return options;
  }
  EngineOptions NotSaving() {
    EngineOptions options = Saving();
    options.save_index_from = 1'000'000;
    return options;
  }
  void Make(int images) {
    Engine engine(Saving());
    AddMany(engine, images);
    Train(engine);
  }
  std::vector<fs::path> Files() const {
    std::vector<fs::path> files;
    for (const fs::directory_entry& entry : fs::directory_iterator(index_)) {
      files.push_back(entry.path());
    }
    std::ranges::sort(files);
    return files;
  }
  // That the index in memory is what the database says; then it is saved.
  void ExpectRight() {
    Engine engine(Saving());
    EXPECT_THAT(engine.Check(), IsEmpty());
    const SearchResult found = engine.Search(RandomPng(3), ByImage(1));
    ASSERT_EQ(found.hits.size(), 1U);
    EXPECT_EQ(found.hits[0].image_id, "p3");
  }
  void Sql(const std::string& statements) const {
    SQLite::Database(database_.string(), SQLite::OPEN_READWRITE).exec(statements);
  }
  static std::string ReadAll(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  static void WriteAll(const fs::path& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
  }

  const fs::path database_ = folder_ / "a.db";
  const fs::path index_ = folder_ / "a.db.index";
  std::mutex mutex_;  // guards warnings_ while an engine lives
  std::vector<std::string> warnings_;
};

TEST_F(IndexFilesTest, AStartReadsThemInsteadOfTheDatabase) {
  EXPECT_EQ(Files().size(), 2U);  // a manifest and a segment
  Sql("UPDATE image_words SET data = x'00'");
  Engine engine(NotSaving());
  const SearchResult found = engine.Search(RandomPng(3), ByImage(1));
  ASSERT_EQ(found.hits.size(), 1U);
  EXPECT_EQ(found.hits[0].image_id, "p3");
  EXPECT_THAT(warnings_, IsEmpty());
}

TEST_F(IndexFilesTest, WhatChangedSinceIsApplied) {
  {
    Engine engine(NotSaving());
    engine.Remove("default", "p1");
    Add(engine, RandomPng(20), "o1", "p2");  // replaced
    Add(engine, RandomPng(21), "o9", "p21");
  }
  const auto before = Files();
  {
    Engine engine(NotSaving());
    EXPECT_THAT(engine.Check(), IsEmpty());
    EXPECT_EQ(engine.Search(RandomPng(20), ByImage(1)).hits.at(0).image_id, "p2");
    EXPECT_EQ(engine.Search(RandomPng(21), ByImage(1)).hits.at(0).image_id, "p21");
    EXPECT_THAT(Ids(engine.Search(RandomPng(1), ByImage(20))), Not(Contains("p1")));
  }
  EXPECT_EQ(Files(), before);
  ExpectRight();
  EXPECT_NE(Files(), before);
  ExpectRight();
}

TEST_F(IndexFilesTest, FilesOfRemovedImagesGo) {
  {
    Engine engine(Saving());
    Add(engine, RandomPng(30), "o9", "a-name-to-forget");
  }
  const auto mentions = [&] {
    return std::ranges::count_if(Files(), [](const fs::path& file) {
      return ReadAll(file).find("a-name-to-forget") != std::string::npos;
    });
  };
  EXPECT_EQ(mentions(), 1);
  {
    Engine engine(Saving());
    engine.Remove("default", "a-name-to-forget");
  }
  EXPECT_EQ(mentions(), 0);
  ExpectRight();
}

TEST_F(IndexFilesTest, WithoutAChangeNothingIsWritten) {
  const auto before = Files();
  const auto bytes = ReadAll(before.front());
  ExpectRight();
  EXPECT_EQ(Files(), before);
  EXPECT_EQ(ReadAll(before.front()), bytes);
}

TEST_F(IndexFilesTest, DamageIsReportedAndMended) {
  for (std::size_t which = 0; which < 2; ++which) {
    std::vector<std::string> damaged;
    const std::string whole = ReadAll(Files().at(which));
    for (const double at : {0.0, 0.01, 0.3, 0.6, 0.999}) {
      damaged.push_back(whole);
      damaged.back()[static_cast<std::size_t>(at * static_cast<double>(whole.size()))] ^= 0x15;
      damaged.push_back(
          whole.substr(0, static_cast<std::size_t>(at * static_cast<double>(whole.size()))));
    }
    for (const std::string& bytes : damaged) {
      WriteAll(Files().at(which), bytes);
      ExpectRight();
      EXPECT_EQ(Files().size(), 2U) << ::testing::PrintToString(warnings_);
      warnings_.clear();
      ExpectRight();
      EXPECT_THAT(warnings_, IsEmpty());
    }
  }
  fs::remove(Files().at(0));
  ExpectRight();
  EXPECT_THAT(warnings_, ::testing::ElementsAre(HasSubstr(".segment")));
  fs::remove_all(index_);
  ExpectRight();
  EXPECT_EQ(Files().size(), 2U);
}

TEST_F(IndexFilesTest, InterruptedSavesAreMadeGood) {
  // Before the manifest was written, and between the signature and the manifest.
  WriteAll(index_ / "1-0123456789abcdef.segment", "the begin");
  WriteAll(index_ / ".1.json.tmp", "{");
  Sql("DELETE FROM saved_indexes");
  ExpectRight();
  EXPECT_EQ(Files().size(), 2U);
  EXPECT_THAT(warnings_, IsEmpty());
  ExpectRight();
}

TEST_F(IndexFilesTest, FilesOfALaterStateOfTheDatabaseAreNotUsed) {
  fs::copy_file(database_, folder_ / "older.db");
  const auto change = [&](std::uint64_t first) {
    Engine engine(Saving());
    engine.Remove("default", "p" + std::to_string(first % 2 + 1));
    for (std::uint64_t i = first; i < first + 4; ++i) {
      Add(engine, RandomPng(i), "o" + std::to_string(i), "p" + std::to_string(i));
    }
  };
  change(40);
  fs::copy_file(folder_ / "older.db", database_, fs::copy_options::overwrite_existing);
  // The same number of changes, but others, with the same keys.
  {
    Engine engine(NotSaving());
    EXPECT_THAT(engine.Check(), IsEmpty());
  }
  change(51);
  ExpectRight();
  Engine engine(Saving());
  EXPECT_EQ(engine.Search(RandomPng(52), ByImage(1)).hits.at(0).image_id, "p52");
}

TEST_F(IndexFilesTest, ThoseOfRemovedCollectionsGo) {
  {
    Engine engine(Saving());
    engine.CreateCollection("other");
    for (int i = 60; i < 64; ++i) {
      const std::vector<std::uint8_t> bytes = RandomPng(static_cast<std::uint64_t>(i));
      AddRequest request;
      request.bytes = bytes;
      request.collection = "other";
      request.id = std::to_string(i);
      engine.Add(request);
    }
    TrainOptions train;
    train.words = 50;
    train.collection = "other";
    engine.TrainVocabulary(train);
  }
  EXPECT_EQ(Files().size(), 4U);
  {
    Engine engine(Saving());
    engine.RemoveCollection("other");
  }
  EXPECT_EQ(Files().size(), 2U);
  ExpectRight();
}

TEST_F(IndexFilesTest, WithoutAFolderEverythingWorks) {
  fs::remove_all(index_);
  WriteAll(index_, "somebody else's");
  ExpectRight();
  EXPECT_THAT(warnings_, ::testing::Each(HasSubstr("a.db.index")));
  EXPECT_EQ(ReadAll(index_), "somebody else's");
}

TEST_F(IndexFilesTest, SmallIndexesAreNotSaved) {
  fs::remove_all(index_);
  {
    Engine engine(NotSaving());
    Add(engine, RandomPng(70), "o9", "p70");
  }
  EXPECT_FALSE(fs::exists(index_));
}

TEST_F(IndexFilesTest, SeveralProcessesShareThem) {
  Engine one(Saving());
  {
    Engine two(Saving());
    Add(two, RandomPng(80), "o9", "p80");
    two.Remove("default", "p1");
  }
  // The files that `one` has mapped are gone.
  EXPECT_THAT(one.Check(), IsEmpty());
  EXPECT_EQ(one.Search(RandomPng(80), ByImage(1)).hits.at(0).image_id, "p80");
  Add(one, RandomPng(81), "o9", "p81");
  ExpectRight();
}

// A search looks into each segment.
TEST_F(IndexFilesTest, SmallFilesBecomeALargeOne) {
  const auto store =
      OpenStore({.database = database_.string(), .create = false, .model_of_new = {}});
  store->BeginWriting([] {});
  const auto feed = store->OpenFeed();
  const Key vocabulary = store->catalogue().RequireCollection("default").vocabulary;
  const fs::path folder = folder_ / "other.index";
  IndexFiles files(folder, 0);
  InvertedIndex index(ByteQuantizer(4));
  std::vector<std::size_t> segments;
  std::int64_t key = 0;
  for (int save = 0; save < 4; ++save) {
    std::vector<IndexedImage> added;
    while (added.size() < InvertedIndex::kMostAtOnce) {
      added.push_back(MakeImage(++key, {{static_cast<std::uint32_t>(key % 4), 1}}));
    }
    index.Append(std::move(added));
    files.Write(*feed, vocabulary, *index.snapshot(), {.image = key},
                [&](auto old, auto same) { index.Exchange(old, std::move(same)); });
    segments.push_back(std::ranges::count_if(
        fs::directory_iterator(folder),
        [](const fs::directory_entry& entry) { return entry.path().extension() == ".segment"; }));
    EXPECT_EQ(index.snapshot()->parts.size(), segments.back());
  }
  EXPECT_THAT(segments, ElementsAre(1, 2, 1, 2));
  const auto saved = files.Read(*feed->Poll(), vocabulary, 4);
  ASSERT_TRUE(saved.has_value());
  EXPECT_EQ(saved->snapshot.images, static_cast<std::size_t>(key));
  EXPECT_TRUE(saved->snapshot.Find(1).has_value());
  EXPECT_TRUE(saved->snapshot.Find(key).has_value());
}

}  // namespace
}  // namespace pliant::testing
