// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Several threads, and several processes on one database.
#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>

#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::IsEmpty;
using ::testing::Not;

TEST_F(EngineTest, ManyThreadsAddRemoveAndSearch) {
  Engine engine(Options());
  AddMany(engine, 4);
  Train(engine, 50);
  std::atomic<int> failures{0};
  const auto guarded = [&](auto work) {
    return [&failures, work] {
      try {
        work();
      } catch (const std::exception& error) {
        ++failures;
        ADD_FAILURE() << error.what();
      }
    };
  };
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 3; ++t) {
      threads.emplace_back(guarded([&engine, t] {
        for (int i = 0; i < 12; ++i) {
          const std::string id = "t" + std::to_string(t) + "-" + std::to_string(i);
          Add(engine, RandomPng(static_cast<std::uint64_t>(1000 + 100 * t + i)), "x", id);
          const SearchResult found = engine.SearchStored(id, ByImage(1));
          ASSERT_EQ(found.hits.at(0).image_id, id) << "an acknowledged image is found at once";
          if (i % 3 == 0) {
            ASSERT_TRUE(engine.Remove("default", id));
          }
        }
      }));
    }
    threads.emplace_back(guarded([&] {
      for (int i = 0; i < 20; ++i)
        ASSERT_EQ(engine.SearchStored("p1", ByImage(1)).hits[0].image_id, "p1");
    }));
    threads.emplace_back(
        guarded([&] { engine.UseVocabulary("default", Train(engine, 30, 3).id); }));
    threads.emplace_back(guarded([&] {
      // The same bytes from two threads: one image.
      std::jthread other([&] { Add(engine, RandomPng(5000), "same"); });
      Add(engine, RandomPng(5000), "same");
    }));
  }
  EXPECT_EQ(failures, 0);
  EXPECT_EQ(engine.Stats().images, 4u + 3 * 8 + 1);
  EXPECT_EQ(engine.Search(RandomPng(1), {}).words, 30u);
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineTest, WhatAnotherProcessDoesIsSeen) {
  Engine server(Options());
  AddMany(server, 4);
  Train(server, 40);
  Engine tool(Options());  // stands for another process: nothing but the file is shared
  Add(tool, RandomPng(9), "new", "new");
  EXPECT_EQ(server.Search(RandomPng(9), ByImage()).hits[0].image_id, "new");
  tool.Remove("default", "p1");
  EXPECT_THAT(Ids(server.Search(RandomPng(1), ByImage())), Not(::testing::Contains("p1")));
  tool.Remove("default", "p4");
  // Removals that are too old are forgotten; whoever missed them must still not show the image.
  SQLite::Database((folder_ / "a.db").string(), SQLite::OPEN_READWRITE)
      .exec("DELETE FROM removals");
  EXPECT_THAT(Ids(server.Search(RandomPng(4), ByImage())), Not(::testing::Contains("p4")));
  Add(tool, RandomPng(10), "new", "p2");  // replaced
  EXPECT_EQ(server.Search(RandomPng(10), ByImage()).hits[0].image_id, "p2");
  tool.UseVocabulary("default", Train(tool, 25, 5).id);
  EXPECT_EQ(server.Search(RandomPng(3), {}).words, 25u);
  Add(server, RandomPng(11), "s", "s");  // quantised with the other's vocabulary
  EXPECT_EQ(tool.Search(RandomPng(11), ByImage()).hits[0].image_id, "s");
  EXPECT_THAT(server.Check(), IsEmpty());
  EXPECT_THAT(tool.Check(), IsEmpty());
}

TEST_F(EngineTest, ALockedDatabaseIsUnavailableAfterTheTimeout) {
  Engine engine(Options());
  AddMany(engine, 1);
  Train(engine, 5);
  SQLite::Database other((folder_ / "a.db").string(), SQLite::OPEN_READWRITE);
  other.exec("BEGIN IMMEDIATE");
  ExpectError(ErrorCode::kUnavailable, "database_busy", [&] { Add(engine, RandomPng(2), "x"); });
  EXPECT_EQ(engine.Search(RandomPng(1), {}).hits.size(), 1u) << "searches go on";
  other.exec("ROLLBACK");
  EXPECT_EQ(Add(engine, RandomPng(2), "x").outcome, AddOutcome::kCreated);
}

}  // namespace
}  // namespace pliant::testing
