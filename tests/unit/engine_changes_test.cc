// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Changing names and metadata in place: nothing is described anew, searches and other processes see
// it at once, and a restart keeps it.
#include <string>
#include <thread>
#include <vector>

#include "index/files/names.h"
#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

ImageChange ToObject(const std::string& object) {
  ImageChange change;
  change.object = object;
  return change;
}

ImageChange Metadata(const std::string& patch) {
  ImageChange change;
  change.metadata = patch;
  return change;
}

ObjectChange Name(const std::string& name, bool merge = false) {
  ObjectChange change;
  change.name = name;
  change.merge = merge;
  return change;
}

std::vector<std::string> Objects(Engine& engine) {
  std::vector<std::string> names;
  for (const ListedObject& object : engine.ListPage(ObjectListing()).records) {
    names.push_back(object.record.object + ":" + std::to_string(object.record.images));
  }
  return names;
}

// By object, so that what the index in memory holds of it counts.
std::string FoundAs(Engine& engine, std::uint64_t seed) {
  return engine.Search(RandomPng(seed), {}).hits.at(0).object;
}

void AddToWinter(Engine& engine, const std::vector<std::uint8_t>& bytes, const std::string& object,
                 const std::string& id) {
  AddRequest add;
  add.collection = "winter";
  add.bytes = bytes;
  add.object = object;
  add.id = id;
  engine.Add(add);
}

TEST(MergeMetadata, IsAMergePatch) {
  EXPECT_EQ(MergeMetadata(R"({"a":1,"b":{"c":2,"d":3}})", R"({"b":{"c":null},"e":[1]})"),
            R"({"a":1,"b":{"d":3},"e":[1]})");
  EXPECT_EQ(MergeMetadata(R"({"a":1})", R"({"a":{"b":2}})"), R"({"a":{"b":2}})");
  EXPECT_EQ(MergeMetadata(R"({"a":1})", "null"), "{}");
  EXPECT_EQ(MergeMetadata(R"({"a":1})", "{}"), R"({"a":1})");
  for (const char* patch : {"[]", "1", "\"x\"", "{", ""}) {
    ExpectError(ErrorCode::kInvalidArgument, "metadata_invalid",
                [&] { MergeMetadata("{}", patch); });
  }
  const std::string half = R"({"a":")" + std::string(40'000, 'x') + R"("})";
  ExpectError(ErrorCode::kInvalidArgument, "metadata_invalid",
              [&] { MergeMetadata(half, R"({"b":")" + std::string(40'000, 'x') + R"("})"); });
}

TEST_F(EngineTest, AnImageMovesToAnotherObjectWithAllItHas) {
  for (const bool files : {false, true}) {
    EngineOptions options = Options();
    options.database = Database(folder_ / (files ? "files.db" : "a.db"));
    if (files) options.originals_dir = folder_ / "originals";
    Engine engine(options);
    AddMany(engine, 4);  // o1 = p1, p2; o2 = p3, p4
    Train(engine, 40);
    Train(engine, 30, 2);
    const int described = descriptor_->calls;
    const ImageRecord before = engine.Get("default", "p1");
    const ImageRecord now = engine.Change("default", "p1", ToObject("o2"));
    EXPECT_EQ(descriptor_->calls, described) << "nothing is described anew";
    EXPECT_EQ(now.object, "o2");
    EXPECT_EQ(now.added_ms, before.added_ms);
    EXPECT_EQ(now.sha256, before.sha256);
    EXPECT_THAT(Objects(engine), ElementsAre("o1:1", "o2:3"));
    EXPECT_EQ(engine.GetContent("default", "p1"), RandomPng(1));
    EXPECT_EQ(FoundAs(engine, 1), "o2");
    EXPECT_EQ(engine.Change("default", "p2", ToObject("new")).object, "new");
    EXPECT_THAT(Objects(engine), ElementsAre("new:1", "o2:3")) << "an object without images goes";
    EXPECT_EQ(engine.Change("default", "p2", ToObject("")).object, "");
    EXPECT_EQ(FoundAs(engine, 2), "");
    EXPECT_EQ(engine.Stats().images, 4u);
    EXPECT_THAT(engine.Check(), IsEmpty());
    EXPECT_EQ(engine.SweepOriginals(), 0u);
    engine.UseVocabulary("default", engine.ListVocabularies("default").at(0).id);
    EXPECT_EQ(FoundAs(engine, 1), "o2") << "it has the words of all vocabularies";
    EXPECT_THAT(Engine(options).Check(), IsEmpty()) << "as loaded anew";
  }
}

TEST_F(EngineTest, MetadataAndSourceChangeInPlace) {
  Engine engine(Options());
  Add(engine, RandomPng(1), "o", "p", R"({"shelf":4,"colour":"red"})");
  Train(engine, 20);
  EXPECT_EQ(engine.Change("default", "p", Metadata(R"({"shelf":5,"colour":null})")).metadata,
            R"({"shelf":5})");
  SearchOptions filtered = ByImage();
  filtered.filter = ParseFilter(R"({"shelf":5})");
  EXPECT_THAT(Ids(engine.Search(RandomPng(1), filtered)), ElementsAre("p"));
  filtered.filter = ParseFilter(R"({"shelf":4})");
  EXPECT_THAT(Ids(engine.Search(RandomPng(1), filtered)), IsEmpty());
  ImageChange all = ToObject("other");
  all.metadata = "null";
  all.source = "name.png";
  const ImageRecord now = engine.Change("default", "p", all);
  EXPECT_EQ(now.metadata + now.source + now.object, "{}name.pngother");
  EXPECT_EQ(engine.Change("default", "p", {}).object, "other") << "nothing is asked for";
}

TEST_F(EngineTest, WhatIsRefusedChangesNothing) {
  Engine engine(Options());
  Add(engine, RandomPng(1), "o", "p", R"({"a":1})");
  Add(engine, RandomPng(2), "o2", "q");
  const auto refused = [&](ErrorCode code, const std::string& reason, const ImageChange& change,
                           const std::string& id = "p") {
    ExpectError(code, reason, [&] { engine.Change("default", id, change); });
  };
  refused(ErrorCode::kNotFound, "image_not_found", ToObject("x"), "nobody");
  refused(ErrorCode::kInvalidArgument, "object_invalid", ToObject("a\nb"));
  refused(ErrorCode::kInvalidArgument, "metadata_invalid", Metadata("[]"));
  ImageChange late = Metadata(R"({"a":2})");
  late.object = "o3";
  late.check = [](const ImageRecord& now) {
    EXPECT_EQ(now.metadata, R"({"a":1})");
    throw Error(ErrorCode::kConflict, "not_now", "somebody was faster");
  };
  refused(ErrorCode::kConflict, "not_now", late);
  EXPECT_EQ(engine.Get("default", "p").metadata, R"({"a":1})");
  const auto kept = [&](ErrorCode code, const std::string& reason, const std::string& object,
                        const ObjectChange& change) {
    ExpectError(code, reason, [&] { engine.ChangeObject("default", object, change); });
  };
  kept(ErrorCode::kNotFound, "object_not_found", "nothing", Name("x"));
  kept(ErrorCode::kInvalidArgument, "object_invalid", "o", Name(""));
  kept(ErrorCode::kConflict, "object_exists", "o", Name("o2"));
  ObjectChange checked = Name("x");
  checked.check = [](const ObjectRecord& now, const std::string& image_id) {
    EXPECT_EQ(now.object + std::to_string(now.images) + image_id, "o1p");
    throw Error(ErrorCode::kConflict, "not_now", "somebody was faster");
  };
  kept(ErrorCode::kConflict, "not_now", "o", checked);
  EXPECT_THAT(Objects(engine), ElementsAre("o:1", "o2:1"));
}

TEST_F(EngineTest, AnObjectIsRenamedWithAllItsImages) {
  Engine engine(Options());
  AddMany(engine, 4);
  Train(engine, 40);
  const ObjectRecord now = engine.ChangeObject("default", "o1", Name("mug"));
  EXPECT_EQ(now.object + std::to_string(now.images), "mug2");
  EXPECT_THAT(Objects(engine), ElementsAre("mug:2", "o2:2"));
  EXPECT_EQ(engine.Get("default", "p2").object, "mug");
  EXPECT_EQ(FoundAs(engine, 1), "mug");
  EXPECT_EQ(engine.ChangeObject("default", "mug", Name("mug")).images, 2u) << "the same name";
  EXPECT_EQ(Engine(Options()).Get("default", "p1").object, "mug");
}

TEST_F(EngineTest, TwoObjectsBecomeOneWhicheverIsLarger) {
  Engine engine(Options());
  AddMany(engine, 4);  // two images each
  Add(engine, RandomPng(9), "o2", "p9");
  Train(engine, 40);
  EXPECT_EQ(engine.ChangeObject("default", "o1", Name("o2", true)).images, 5u);
  EXPECT_THAT(Objects(engine), ElementsAre("o2:5"));
  Add(engine, RandomPng(10), "small", "p10");
  EXPECT_EQ(engine.ChangeObject("default", "o2", Name("small", true)).images, 6u);
  EXPECT_THAT(Objects(engine), ElementsAre("small:6"));
  for (const int seed : {1, 3, 9, 10}) EXPECT_EQ(FoundAs(engine, seed), "small") << seed;
  const SearchResult grouped = engine.Search(RandomPng(1), {});
  EXPECT_EQ(grouped.total, 1u) << "the index in memory knows one object";
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineTest, AnImageAndAnObjectMoveToAnotherCollection) {
  for (const bool files : {false, true}) {
    EngineOptions options = Options();
    options.database = Database(folder_ / (files ? "files.db" : "a.db"));
    if (files) options.originals_dir = folder_ / "originals";
    Engine engine(options);
    AddMany(engine, 6);  // o1 = p1, p2; o2 = p3, p4; o3 = p5, p6
    Train(engine, 40);
    engine.CreateCollection("winter");
    AddToWinter(engine, RandomPng(20), "o2", "q1");
    TrainOptions train;
    train.collection = "winter";
    train.words = 10;
    engine.TrainVocabulary(train);
    const int described = descriptor_->calls;
    ImageChange move = Metadata(R"({"a":1})");
    move.collection = "winter";
    const ImageRecord now = engine.Change("default", "p1", move);
    EXPECT_EQ(now.collection + now.object + now.metadata, R"(wintero1{"a":1})");
    ObjectChange all = Name("o2");
    all.collection = "winter";
    ExpectError(ErrorCode::kConflict, "object_exists",
                [&] { engine.ChangeObject("default", "o2", all); });
    all.merge = true;
    EXPECT_EQ(engine.ChangeObject("default", "o2", all).images, 3U);
    EXPECT_EQ(descriptor_->calls, described) << "nothing is described again";
    EXPECT_THAT(Objects(engine), ElementsAre("o1:1", "o3:2"));
    EXPECT_EQ(engine.GetCollection("winter").images, 4U);
    EXPECT_EQ(engine.GetCollection("default").images, 3U);
    EXPECT_EQ(engine.GetContent("winter", "p3"), RandomPng(3));
    SearchOptions there;
    there.collection = "winter";
    EXPECT_EQ(engine.Search(RandomPng(3), there).hits.at(0).object, "o2");
    EXPECT_EQ(engine.Search(RandomPng(1), there).hits.at(0).image_id, "p1");
    for (const Hit& hit : engine.Search(RandomPng(3), {}).hits) EXPECT_NE(hit.object, "o2");
    EXPECT_EQ(FoundAs(engine, 5), "o3");
    EXPECT_THAT(engine.Check(), IsEmpty());
    EXPECT_EQ(engine.SweepOriginals(), 0U);
    EXPECT_THAT(Engine(options).Check(), IsEmpty()) << "as loaded again";
  }
}

TEST_F(EngineTest, AMoveThatIsRefusedMovesNothing) {
  Engine engine(Options());
  AddMany(engine, 2);  // o1 = p1, p2
  engine.CreateCollection("winter");
  AddToWinter(engine, RandomPng(9), "other", "p2");
  ObjectChange all = Name("o1");
  all.collection = "winter";
  ExpectError(ErrorCode::kConflict, "image_exists",
              [&] { engine.ChangeObject("default", "o1", all); });
  ImageChange move;
  move.collection = "winter";
  ExpectError(ErrorCode::kConflict, "image_exists", [&] { engine.Change("default", "p2", move); });
  move.collection = all.collection = "nowhere";
  ExpectError(ErrorCode::kNotFound, "collection_not_found",
              [&] { engine.Change("default", "p1", move); });
  ExpectError(ErrorCode::kNotFound, "collection_not_found",
              [&] { engine.ChangeObject("default", "o1", all); });
  EXPECT_THAT(Objects(engine), ElementsAre("o1:2"));
  EXPECT_EQ(engine.GetCollection("winter").images, 1U);
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineTest, AnotherProcessSeesChanges) {
  Engine server(Options());
  AddMany(server, 4);
  Train(server, 40);
  Engine tool(Options());
  EXPECT_EQ(FoundAs(server, 1), "o1");
  tool.ChangeObject("default", "o1", Name("o9"));
  EXPECT_EQ(FoundAs(server, 1), "o9");
  tool.Change("default", "p1", ToObject("o2"));
  EXPECT_EQ(FoundAs(server, 1), "o2");
  tool.ChangeObject("default", "o9", Name("o2", true));
  EXPECT_EQ(server.Search(RandomPng(1), {}).total, 1u);
  EXPECT_THAT(server.Check(), IsEmpty());
}

TEST_F(EngineTest, ChangesBesideRemovalsAndTraining) {
  Engine engine(Options());
  AddMany(engine, 6);
  Train(engine, 40);
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 2; ++t) {
      threads.emplace_back([&engine, t] {
        for (int i = 0; i < 30; ++i) {
          engine.Change("default", "p" + std::to_string(1 + (i + t) % 4),
                        ToObject("o" + std::to_string(i % 5)));
        }
      });
    }
    threads.emplace_back([&engine] {
      for (int i = 0; i < 10; ++i) {
        engine.Remove("default", "p6");
        Add(engine, RandomPng(6), "o3", "p6");
        EXPECT_EQ(engine.SearchStored("p6", ByImage(1)).hits.at(0).image_id, "p6");
      }
    });
    threads.emplace_back([&engine] { engine.UseVocabulary("default", Train(engine, 30, 3).id); });
  }
  EXPECT_EQ(engine.Stats().images, 6u);
  EXPECT_THAT(engine.Check(), IsEmpty());
  for (int i = 1; i <= 4; ++i) {
    const std::string id = "p" + std::to_string(i);
    EXPECT_EQ(engine.SearchStored(id, ByImage(1)).hits.at(0).image_id, id);
  }
}

}  // namespace
}  // namespace pliant::testing
