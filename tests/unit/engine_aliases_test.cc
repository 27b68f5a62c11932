// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Other names of collections: for people, and aliases that are moved from one to another.
#include <atomic>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/engine_fixture.h"

namespace pliant {
namespace {

using ::testing::ElementsAre;
using testing::EngineTest;
using testing::ExpectError;
using ::testing::IsEmpty;
using testing::RandomPng;

class EngineAliasesTest : public EngineTest {
 protected:
  static void Add(Engine& engine, const std::string& collection, int seed,
                  const std::string& object) {
    const std::vector<std::uint8_t> png = RandomPng(seed);
    AddRequest request;
    request.collection = collection;
    request.object = object;
    request.bytes = png;
    engine.Add(request);
  }
};

std::vector<ListedObject> ObjectsOf(Engine& engine, const std::string& collection) {
  ObjectListing list;
  list.which.collection = collection;
  return engine.ListPage(list).records;
}

TEST_F(EngineAliasesTest, AnAliasIsGoodWhereverACollectionIsNamed) {
  Engine engine(Options());
  engine.CreateCollection("shirts-1");
  engine.ChangeAliases({{"live", "shirts-1"}});
  EXPECT_EQ(engine.CollectionName("live"), "shirts-1");
  EXPECT_EQ(engine.CollectionName("shirts-1"), "shirts-1");
  for (int i = 0; i < 4; ++i) Add(engine, "live", i, "shirt");
  EXPECT_EQ(engine.GetCollection("shirts-1").images, 4u);
  EXPECT_EQ(engine.GetCollection("live").name, "shirts-1");
  EXPECT_THAT(engine.GetCollection("shirts-1").aliases, ElementsAre("live"));
  EXPECT_FALSE(engine.GetCollection("live").vocabulary);
  TrainOptions train;
  train.collection = "live";
  train.words = 10;
  engine.TrainVocabulary(train);
  SearchOptions search;
  search.collection = "live";
  const SearchResult found = engine.Search(RandomPng(1), search);
  ASSERT_FALSE(found.hits.empty());
  EXPECT_EQ(found.hits[0].object, "shirt");
  EXPECT_EQ(ObjectsOf(engine, "live").size(), 1u);
  EXPECT_EQ(engine.RemoveObject("live", "shirt"), 4u);
  EXPECT_FALSE(engine.CreateCollection("live")) << "it is there";
  EXPECT_THAT(engine.ListCollections(), ElementsAre("default", "shirts-1"));
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineAliasesTest, AnAliasIsMovedAndRemovedAndGoesWithItsCollection) {
  Engine engine(Options());
  for (const char* name : {"a", "b"}) engine.CreateCollection(name);
  Add(engine, "a", 1, "one");
  Add(engine, "b", 2, "two");
  engine.ChangeAliases({{"live", "a"}, {"next", "b"}});
  EXPECT_EQ(ObjectsOf(engine, "live")[0].record.object, "one");
  engine.ChangeAliases({{"live", "b"}, {"before", "a"}, {"next", std::nullopt}});
  EXPECT_EQ(ObjectsOf(engine, "live")[0].record.object, "two");
  const std::vector<AliasRecord> aliases = engine.ListAliases();
  ASSERT_EQ(aliases.size(), 2u);
  EXPECT_EQ(aliases[0].name, "before");
  EXPECT_EQ(aliases[0].collection, "a");
  EXPECT_GT(aliases[1].updated_ms, 0);
  ExpectError(ErrorCode::kConflict, "collection_is_alias",
              [&] { engine.RemoveCollection("live"); });
  EXPECT_TRUE(engine.RemoveCollection("b"));
  ExpectError(ErrorCode::kNotFound, "collection_not_found", [&] { engine.CollectionName("live"); });
  EXPECT_EQ(engine.ListAliases().size(), 1u);
  Engine other(Options());  // as it was written down
  EXPECT_EQ(other.CollectionName("before"), "a");
}

TEST_F(EngineAliasesTest, WhatCannotBeAnAliasChangesNothing) {
  Engine engine(Options());
  engine.CreateCollection("a");
  engine.ChangeAliases({{"live", "a"}});
  const auto change = [&](const AliasChanges& changes) {
    return [&engine, changes] { engine.ChangeAliases(changes); };
  };
  ExpectError(ErrorCode::kConflict, "collection_exists", change({{"b", "a"}, {"default", "a"}}));
  ExpectError(ErrorCode::kNotFound, "collection_not_found", change({{"b", "a"}, {"c", "none"}}));
  ExpectError(ErrorCode::kNotFound, "collection_not_found", change({{"b", "live"}}));
  ExpectError(ErrorCode::kNotFound, "alias_not_found", change({{"b", "a"}, {"x", std::nullopt}}));
  ExpectError(ErrorCode::kInvalidArgument, "alias_invalid", change({{"b", "a"}, {"a/b", "a"}}));
  ExpectError(ErrorCode::kInvalidArgument, "alias_invalid", change({{"", "a"}}));
  EXPECT_EQ(engine.ListAliases().size(), 1u);
}

// Whoever searches by the alias sees one collection or the other, and never none.
TEST_F(EngineAliasesTest, MovingIsSeenAtOnceByAnotherProcess) {
  Engine writer(Options());
  writer.CreateCollection("a");
  writer.CreateCollection("b");
  Add(writer, "a", 1, "one");
  Add(writer, "b", 2, "two");
  writer.ChangeAliases({{"live", "a"}});
  Engine reader(Options());
  std::atomic<bool> stop{false};
  std::atomic<int> looks{0};
  std::atomic<int> wrong{0};
  std::thread looking([&] {
    while (!stop) {
      const auto objects = ObjectsOf(reader, "live");
      if (objects.size() != 1) ++wrong;
      ++looks;
    }
  });
  for (int i = 0; i < 50 || looks < 50; ++i) {
    writer.ChangeAliases({{"live", i % 2 == 0 ? "b" : "a"}});
    EXPECT_EQ(reader.CollectionName("live"), i % 2 == 0 ? "b" : "a");
  }
  stop = true;
  looking.join();
  EXPECT_EQ(wrong, 0);
}

TEST_F(EngineAliasesTest, CollectionsHaveNamesForPeople) {
  Engine engine(Options());
  engine.CreateCollection("shirts-2026");
  EXPECT_EQ(engine.ChangeCollection("shirts-2026", {.display_name = "Été 2026!"}).display_name,
            "Été 2026!");
  EXPECT_EQ(engine.ChangeCollection("shirts-2026", {}).display_name, "Été 2026!");
  engine.ChangeAliases({{"live", "shirts-2026"}});
  EXPECT_EQ(engine.GetCollection("default").display_name, "");
  EXPECT_EQ(engine.GetCollection("live").display_name, "Été 2026!");
  for (const std::string& bad : {std::string(201, 'x'), std::string("a\nb"), std::string("a\xff"),
                                 std::string("a\xe2\x80\xae"
                                             "b")}) {
    ExpectError(ErrorCode::kInvalidArgument, "display_name_invalid",
                [&] { engine.ChangeCollection("shirts-2026", {.display_name = bad}); });
  }
  ExpectError(ErrorCode::kNotFound, "collection_not_found",
              [&] { engine.ChangeCollection("none", {.display_name = "x"}); });
  EXPECT_EQ(engine.ChangeCollection("live", {.display_name = ""}).display_name, "");
}

}  // namespace
}  // namespace pliant
