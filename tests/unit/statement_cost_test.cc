// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What is asked of one image must not read them all. SQLite chooses indexes by itself, and a
// wrong choice answers rightly, only ever more slowly; so the steps of its virtual machine are
// counted.
#include <algorithm>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "tests/unit/engine_fixture.h"

namespace pliant {
namespace {

using testing::RandomPng;

struct Cost {
  std::uint64_t most = 0;  // steps of one run
  std::uint64_t all = 0;   // of all runs
};

// The statements that ran on any connection since Clear().
class Statements {
 public:
  static void Watch() {
    ASSERT_EQ(sqlite3_auto_extension(reinterpret_cast<void (*)()>(&Open)), SQLITE_OK);
  }
  static void Clear() {
    const std::scoped_lock lock(mutex_);
    costs_.clear();
  }
  static std::map<std::string, Cost> Costs() {
    const std::scoped_lock lock(mutex_);
    return costs_;
  }

 private:
  static int Open(sqlite3* db, char** /*error*/, const void* /*routines*/) {
    return sqlite3_trace_v2(db, SQLITE_TRACE_PROFILE, &Ended, nullptr);
  }
  static int Ended(unsigned /*event*/, void* /*context*/, void* statement, void* /*nanoseconds*/) {
    auto* const ended = static_cast<sqlite3_stmt*>(statement);
    const int steps = sqlite3_stmt_status(ended, SQLITE_STMTSTATUS_VM_STEP, 1);
    const std::scoped_lock lock(mutex_);
    Cost& cost = costs_[sqlite3_sql(ended)];
    cost.most = std::max(cost.most, static_cast<std::uint64_t>(steps));
    cost.all += static_cast<std::uint64_t>(steps);
    return 0;
  }

  static inline std::mutex mutex_;
  static inline std::map<std::string, Cost> costs_;
};

constexpr std::uint64_t kImages = 1200;
// Reading one row takes two steps at the least: the next one, and something of it.
constexpr std::uint64_t kAllOfThem = 2 * kImages;

class StatementCostTest : public testing::EngineTest {
 protected:
  static void SetUpTestSuite() { Statements::Watch(); }
  static void TearDownTestSuite() { sqlite3_reset_auto_extension(); }

  // Twelve described images, and many more with their features.
  void SetUp() override {
    {
      Engine engine(Options());
      AddMany(engine, 12);
      Train(engine, 60);
    }
    SQLite::Database db((folder_ / "a.db").string(), SQLite::OPEN_READWRITE);
    db.exec(
        "BEGIN;"
        "CREATE TEMP TABLE many AS WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n "
        "WHERE i < " +
        std::to_string(kImages) +
        ") SELECT i, 100 + i AS key, "
        "(SELECT key FROM images WHERE id = 'p' || (1 + i % 12)) AS alike FROM n;"
        "INSERT INTO objects (key, collection, name, natural_name) SELECT key, 1, 'many' || i, "
        "'many' || substr('00000' || i, -5) FROM many;"
        "INSERT INTO images (key, collection, id, object, sha256, media_type, width, height, "
        "bytes, keypoints, metadata, source, added_ms, updated_ms) SELECT m.key, 1, 'm' || m.i, "
        "m.key, randomblob(32), p.media_type, p.width, p.height, p.bytes, p.keypoints, p.metadata, "
        "p.source, p.added_ms + m.i, p.updated_ms + m.i FROM many m JOIN images p ON p.key = "
        "m.alike;"
        "INSERT INTO features SELECT m.key, f.model, f.data FROM many m JOIN features f ON "
        "f.image = m.alike;"
        "INSERT INTO image_words (vocabulary, image, data) SELECT w.vocabulary, m.key, w.data "
        "FROM many m JOIN image_words w ON w.image = m.alike;"
        "COMMIT");
  }

  static void ExpectSteps(const std::string& doing, std::uint64_t most) {
    for (const auto& [sql, cost] : Statements::Costs()) {
      EXPECT_LT(cost.most, most) << doing << ": " << sql;
    }
    Statements::Clear();
  }
};

TEST_F(StatementCostTest, WhatIsAskedOfOneImageDoesNotReadAll) {
  Engine engine(Options());
  Engine other(Options());
  SearchOptions search = ByImage();
  search.verify_depth = 10;
  other.SearchStored("m7", search);
  const auto bytes = RandomPng(99);
  const auto expect = [](const std::string& doing) { ExpectSteps(doing, kAllOfThem); };
  Statements::Clear();

  EXPECT_EQ(Add(engine, bytes, "new").outcome, AddOutcome::kCreated);
  expect("adding");
  other.SearchStored("m7", search);
  expect("searching, and following what was added");
  EXPECT_EQ(Add(engine, bytes, "new").outcome, AddOutcome::kUnchanged);
  expect("adding again");
  EXPECT_EQ(Add(engine, bytes, "newer", "m3").outcome, AddOutcome::kReplaced);
  expect("replacing");
  ImageChange change;
  change.object = "newer";
  engine.Change("default", "m4", change);
  expect("changing");
  ObjectChange renaming;
  renaming.name = "other5";
  engine.ChangeObject("default", "many5", renaming);
  expect("renaming an object");
  EXPECT_TRUE(engine.FindBySha256("default", engine.Get("default", "m6").sha256));
  engine.GetFeatures("default", "m6");
  engine.GetContent("default", "p6");
  engine.GetObject("default", "many6");
  engine.GetCollection("default");
  expect("reading");
  EXPECT_TRUE(engine.Remove("default", "m8"));
  EXPECT_EQ(engine.RemoveObject("default", "many9"), 1U);
  expect("removing");
  other.SearchStored("m7", search);
  expect("searching, and following what was removed");
}

TEST_F(StatementCostTest, APageReadsNoMoreThanAPage) {
  Engine engine(Options());
  Statements::Clear();
  for (const auto order : {ImageOrder::kId, ImageOrder::kCreated, ImageOrder::kUpdated}) {
    ImageListing images;
    images.limit = 20;
    images.order = order;
    images.after = engine.ListPage(images).next.value_or("");
    EXPECT_EQ(engine.ListPage(images).records.size(), 20U);
  }
  ExpectSteps("a page of images", kAllOfThem);
  ObjectListing objects;
  objects.limit = 20;
  objects.after = engine.ListPage(objects).next.value_or("");
  EXPECT_EQ(engine.ListPage(objects).records.size(), 20U);
  for (const char* object : {"many2", ""}) {
    ImageListing list;
    list.which.object = object;
    list.limit = 20;
    engine.ListPage(list);
  }
  ExpectSteps("a page of objects", kAllOfThem);
}

// Everything is read, but once: not again for every batch.
TEST_F(StatementCostTest, TrainingReadsEachImageAFewTimes) {
  Engine engine(Options());
  Statements::Clear();
  Train(engine, 60, 2);
  for (const auto& [sql, cost] : Statements::Costs()) {
    EXPECT_LT(cost.all, 100 * kImages) << sql;
  }
}

}  // namespace
}  // namespace pliant
