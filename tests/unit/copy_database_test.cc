// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Copies of databases: everything is there, a second copy is no work, and rankings are the same.
#include "index/engine/copy_database.h"

#include "index/store/open_store.h"
#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class CopyDatabaseTest : public EngineTest {
 protected:
  EngineOptions OptionsOf(const std::string& name) {
    EngineOptions options = Options();
    options.database = Database(folder_ / name);
    return options;
  }
  CopyOptions Copy(const std::string& to = "copy.db") {
    CopyOptions options;
    options.from = Options().database;
    options.to = Database(folder_ / to);
    return options;
  }
  static void ExpectSame(const ImageRecord& a, const ImageRecord& b) {
    EXPECT_EQ(a.id, b.id);
    EXPECT_EQ(a.object, b.object);
    EXPECT_EQ(a.sha256, b.sha256);
    EXPECT_EQ(a.metadata, b.metadata);
    EXPECT_EQ(a.source, b.source);
    EXPECT_EQ(a.media_type, b.media_type);
    EXPECT_EQ(a.keypoints, b.keypoints);
    EXPECT_EQ(a.bytes, b.bytes);
    EXPECT_EQ(a.added_ms, b.added_ms);
    EXPECT_EQ(a.updated_ms, b.updated_ms);
  }
};

TEST_F(CopyDatabaseTest, AllIsThereAndRanksAlike) {
  {
    Engine engine(Options());
    AddMany(engine, 6);
    Add(engine, RandomPng(7), "", "labelled", R"({"shelf":4})");
    Train(engine, 60);
    engine.CreateCollection("toys");
    engine.ChangeCollection("toys", {.display_name = "Summer toys!"});
    engine.ChangeAliases({{"now", "toys"}});
    OpenServiceStore(Options().database)
        ->AddKey({"0a1b2c3d", "desk", "read", std::string(64, 'a'), 5, 0});
  }
  const CopyResult result = CopyDatabase(Copy());
  EXPECT_EQ(result.collections, 2U);
  EXPECT_EQ(result.copied, 7U);
  EXPECT_EQ(result.unchanged, 0U);
  EXPECT_EQ(result.vocabularies, 1U);
  EXPECT_EQ(result.keys, 1U);
  EXPECT_EQ(result.without_content, 0U);

  Engine from(Options());
  Engine to(OptionsOf("copy.db"));
  EXPECT_THAT(to.Check(), IsEmpty());
  for (const char* id : {"p1", "p6", "labelled"}) {
    ExpectSame(from.Get("default", id), to.Get("default", id));
    EXPECT_EQ(from.GetContent("default", id), to.GetContent("default", id));
  }
  EXPECT_EQ(to.GetCollection("now").display_name, "Summer toys!");
  const RankingsCompared compared = CompareRankings(from, to, 100);
  EXPECT_EQ(compared.compared, 7U);
  EXPECT_THAT(compared.differences, IsEmpty());
  EXPECT_EQ(OpenServiceStore(Copy().to)->Keys().at(0).hash, std::string(64, 'a'));
}

TEST_F(CopyDatabaseTest, GoesOnWhereItWasAndNamesWhatIsMore) {
  Engine engine(Options());
  AddMany(engine, 4);
  Train(engine, 40);
  CopyDatabase(Copy());
  Add(engine, RandomPng(20), "new", "p5");  // since
  Add(engine, RandomPng(21), "o1", "p1");   // another image in its place
  engine.Remove("default", "p2");           // stays in the copy
  const CopyResult again = CopyDatabase(Copy());
  EXPECT_EQ(again.copied, 2U);
  EXPECT_EQ(again.unchanged, 2U);
  EXPECT_EQ(again.extra, 1U);
  EXPECT_EQ(again.vocabularies, 0U);
  EXPECT_EQ(CopyDatabase(Copy()).copied, 0U);

  Engine copy(OptionsOf("copy.db"));
  EXPECT_EQ(copy.Get("default", "p1").sha256, engine.Get("default", "p1").sha256);
  EXPECT_EQ(copy.GetCollection("default").images, 5U);
  EXPECT_THAT(Ids(copy.SearchStored("p5", ByImage(1))), ElementsAre("p5"));
  // A ranking that differs is said to.
  copy.Remove("default", "p3");
  EXPECT_FALSE(CompareRankings(engine, copy, 100).differences.empty());
}

TEST_F(CopyDatabaseTest, WhatWasCommittedBeforeAStopStays) {
  Engine engine(Options());
  AddMany(engine, 6);
  std::stop_source stop;
  CopyOptions stopped = Copy();
  stopped.commit_every = 2;
  stopped.stop = stop.get_token();
  std::vector<std::uint64_t> done;
  stopped.progress = [&](std::uint64_t images, std::uint64_t) {
    done.push_back(images);
    if (images >= 2) stop.request_stop();
  };
  ExpectError(ErrorCode::kCancelled, "cancelled", [&] { CopyDatabase(stopped); });
  EXPECT_THAT(done, ElementsAre(0, 2));
  // The second two were on their way when it stopped: they are there, too.
  const CopyResult rest = CopyDatabase(Copy());
  EXPECT_EQ(rest.unchanged, 4U);
  EXPECT_EQ(rest.copied, 2U);
}

TEST_F(CopyDatabaseTest, RefusesWhatCannotBeCopied) {
  Engine engine(Options());
  CopyOptions itself = Copy();
  itself.to = itself.from;
  ExpectError(ErrorCode::kInvalidArgument, "same_database", [&] { CopyDatabase(itself); });
  CopyOptions nothing = Copy();
  nothing.from = folder_ / "no.db";
  ExpectError(ErrorCode::kNotFound, "database_not_found", [&] { CopyDatabase(nothing); });
  EngineOptions other = OptionsOf("other.db");
  other.descriptor = "orb";
  other.custom_descriptor = MakeDescriptor("orb");
  {
    Engine orb(other);  // makes the database
  }
  ExpectError(ErrorCode::kConflict, "model_mismatch", [&] { CopyDatabase(Copy("other.db")); });
  std::stop_source stop;
  stop.request_stop();
  CopyOptions stopped = Copy();
  stopped.stop = stop.get_token();
  AddMany(engine, 1);
  ExpectError(ErrorCode::kCancelled, "cancelled", [&] { CopyDatabase(stopped); });
}

}  // namespace
}  // namespace pliant::testing
