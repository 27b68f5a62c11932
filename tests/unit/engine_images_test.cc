// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Adding, listing and removing images, objects and collections.
#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "descriptor/base/sha256.h"
#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Not;

TEST_F(EngineTest, ANewImageIsStoredWithAllThatIsKnownOfIt) {
  Engine engine(Options());
  const std::vector<std::uint8_t> png = RandomPng(1);
  const AddResult added = Add(engine, png, "cup", {}, R"({"b": 1, "a": [true]})");
  EXPECT_EQ(added.outcome, AddOutcome::kCreated);
  const ImageRecord record = engine.Get("default", added.image.id);
  EXPECT_EQ(record.id, Sha256Hex(png).substr(0, 32));
  EXPECT_EQ(record.sha256, Sha256Hex(png));
  EXPECT_EQ(record.object, "cup");
  EXPECT_EQ(record.media_type, "image/png");
  EXPECT_EQ(record.metadata, R"({"a":[true],"b":1})");
  EXPECT_EQ(record.source, "somewhere/cup");
  EXPECT_EQ(record.width, 160);
  EXPECT_EQ(record.height, 120);
  EXPECT_EQ(record.bytes, png.size());
  EXPECT_GT(record.keypoints, 50u);
  EXPECT_GT(record.added_ms, 1'600'000'000'000);
  EXPECT_EQ(engine.GetContent("default", record.id), png);
  const Features features = engine.GetFeatures("default", record.id);
  EXPECT_EQ(features.keypoints.size(), record.keypoints);
  EXPECT_EQ(features.model_id, descriptor_->info().model_id);
  EXPECT_EQ(engine.FindBySha256("default", record.sha256)->id, record.id);
  EXPECT_FALSE(engine.FindBySha256("default", std::string(64, '0')));
  EXPECT_FALSE(engine.FindBySha256("default", "nonsense"));
}

TEST_F(EngineTest, TheSameBytesAreNoWork) {
  Engine engine(Options());
  const std::string id = Add(engine, RandomPng(1), "cup").image.id;
  const int calls = descriptor_->calls;
  ASSERT_GE(calls, 1);
  EXPECT_EQ(Add(engine, RandomPng(1), "cup").outcome, AddOutcome::kUnchanged);
  EXPECT_EQ(Add(engine, RandomPng(1), "").outcome, AddOutcome::kUnchanged) << "nothing was said";
  EXPECT_EQ(Add(engine, RandomPng(1), "cup", id).outcome, AddOutcome::kUnchanged);
  // Another object or other metadata is neither taken over nor dropped in silence.
  ExpectError(ErrorCode::kConflict, "same_bytes", [&] { Add(engine, RandomPng(1), "other"); });
  ExpectError(ErrorCode::kConflict, "same_bytes",
              [&] { Add(engine, RandomPng(1), "cup", {}, R"({"a":2})"); });
  EXPECT_EQ(engine.Get("default", id).object, "cup");
  // Under another id, and with other metadata: stored anew, not described anew.
  EXPECT_EQ(Add(engine, RandomPng(1), "cup", "twin").outcome, AddOutcome::kCreated);
  EXPECT_EQ(Add(engine, RandomPng(1), "cup", "twin", R"({"a":1})").outcome, AddOutcome::kReplaced);
  EXPECT_EQ(engine.Get("default", "twin").metadata, R"({"a":1})");
  EXPECT_EQ(Add(engine, RandomPng(1), "cup", {}, R"({"a":1})").image.id, "twin");
  EXPECT_EQ(descriptor_->calls, calls);
  EXPECT_EQ(engine.GetFeatures("default", "twin").keypoints,
            engine.GetFeatures("default", id).keypoints);
  // Other bytes under a known id.
  EXPECT_EQ(Add(engine, RandomPng(2), "cup", "twin").outcome, AddOutcome::kReplaced);
  EXPECT_EQ(descriptor_->calls, 2 * calls);
  EXPECT_EQ(engine.Stats().images, 2u);
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineTest, WhatIsNoImageIsRefusedAndLeavesNothing) {
  Engine engine(Options());
  const auto add = [&](const std::string& text) {
    return [&engine, text] { Add(engine, {text.begin(), text.end()}, "x"); };
  };
  ExpectError(ErrorCode::kUnsupportedMediaType, "", add("hello, this is text"));
  ExpectError(ErrorCode::kUnprocessable, "image_empty", add(""));
  const Image plain{64, 64, 1, std::vector<std::uint8_t>(64 * 64, 7)};
  ExpectError(ErrorCode::kUnprocessable, "too_few_features",
              [&] { Add(engine, EncodePng(plain), "x"); });
  EXPECT_EQ(engine.Stats().images, 0u);
  EXPECT_EQ(engine.Stats().objects, 0u);
}

TEST_F(EngineTest, BadNamesAndMetadataAreNamed) {
  Engine engine(Options());
  const std::vector<std::uint8_t> png = RandomPng(1);
  for (const std::string id : {"", ".", "..", "a/b", "a b", "\xff", "\n"}) {
    ExpectError(ErrorCode::kInvalidArgument, "id_invalid", [&] { Add(engine, png, "x", id); });
  }
  ExpectError(ErrorCode::kInvalidArgument, "id_invalid",
              [&] { Add(engine, png, "x", std::string(129, 'a')); });
  for (const std::string object : {"a\nb",
                                   "\xc3\x28",
                                   "\xed\xa0\x80",
                                   "\xf5\x80\x80\x80",
                                   "shirt\u202Egpj.exe",
                                   "shi\u200Drt",
                                   "shi\u200Brt",
                                   ".",
                                   "..",
                                   "\uFEFFshirt",
                                   "\u05D0\u200D",
                                   "shirt\u2069",
                                   "mug\u009B31m",
                                   "mug\u3164",
                                   "mug\u115F",
                                   "mug\u034F",
                                   "mug\u17B4",
                                   "mug\u2800",
                                   "mug\uFE0F",
                                   "mug\U0001D173",
                                   "\u2764\uFE0F\uFE0F",
                                   "  "}) {
    ExpectError(ErrorCode::kInvalidArgument, "object_invalid", [&] { Add(engine, png, object); });
  }
  for (const std::string metadata : {"", "[]", "1", "{", "{\"a\":\"\xff\"}", "nonsense"}) {
    ExpectError(ErrorCode::kInvalidArgument, "metadata_invalid",
                [&] { Add(engine, png, "x", {}, metadata); });
  }
  std::string deep = "1";
  for (int i = 0; i < 40; ++i) deep = "{\"a\":" + deep + "}";
  ExpectError(ErrorCode::kInvalidArgument, "metadata_invalid",
              [&] { Add(engine, png, "x", {}, deep); });
  std::string growing = "{\"a\":[1e9";  // 1000000000.0 when it is written out
  while (growing.size() < 60'000) growing += ",1e9";
  ExpectError(ErrorCode::kInvalidArgument, "metadata_invalid",
              [&] { Add(engine, png, "x", {}, growing + "]}"); });
  std::string many = "{\"a\": [{\"0\": 0";  // a name is looked up among all of its object
  for (int i = 1; i < 1001; ++i) many += ", \"" + std::to_string(i) + "\": 0";
  ExpectError(ErrorCode::kInvalidArgument, "metadata_invalid",
              [&] { Add(engine, png, "x", {}, many + "}]}"); });
  AddRequest request;
  request.bytes = png;
  request.collection = "nowhere";
  ExpectError(ErrorCode::kNotFound, "collection_not_found", [&] { engine.Add(request); });
  engine.CreateCollection("nowhere");
  const std::int64_t created_ms = engine.GetCollection("nowhere").created_ms;
  request.collection_created_ms = created_ms - 1;  // another of the name, removed since
  ExpectError(ErrorCode::kNotFound, "collection_not_found", [&] { engine.Add(request); });
  EXPECT_EQ(engine.GetCollection("nowhere").images, 0U);
  request.collection_created_ms = created_ms;
  EXPECT_EQ(engine.Add(request).outcome, AddOutcome::kCreated);
  EXPECT_EQ(Add(engine, png, "Tasse \xc3\xa4\xf0\x9f\x98\x80").outcome, AddOutcome::kCreated);
  // Joiners belong to Persian and to emojis.
  EXPECT_EQ(Add(engine, RandomPng(2), "\u0645\u06CC\u200C\u062E").outcome, AddOutcome::kCreated);
  EXPECT_EQ(Add(engine, RandomPng(3), "\U0001F469\u200D\U0001F4BB").outcome, AddOutcome::kCreated);
  EXPECT_EQ(Add(engine, RandomPng(4), "\u2764\uFE0F\u200D\U0001F525 1\uFE0F\u20E3").outcome,
            AddOutcome::kCreated);
}

TEST_F(EngineTest, AFilesNameIsShownAsItIs) {
  Engine engine(Options());
  const auto stored = [&](std::uint64_t image, const std::string& name) {
    const std::vector<std::uint8_t> png = RandomPng(image);
    AddRequest request;
    request.bytes = png;
    request.source = name;
    return engine.Add(request).image.source;
  };
  EXPECT_EQ(stored(1, "shirt\u202Egpj.exe"), "shirt\\u{202e}gpj.exe");
  EXPECT_EQ(stored(2, "shi\u200Brt\n\xff.jpg"), "shi\\u{200b}rt\\x0a\\xff.jpg");
  EXPECT_EQ(stored(3, "\u202E\u200D\u0645\u200C\u062E"), "\\u{202e}\\u{200d}\u0645\u200C\u062E");
  EXPECT_EQ(stored(4, "\u0645\xff\u200D."), "\u0645\\xff\\u{200d}.");
  EXPECT_EQ(stored(5, "mug\u009B31m"), "mug\\u{9b}31m");
  const std::string id = engine.ListPage(ImageListing()).records.at(0).id;
  for (const std::string name : {"shirt\u202Egpj.exe", "a\nb", "\xff"}) {
    ImageChange change;  // said by a person, so it is refused
    change.source = name;
    ExpectError(ErrorCode::kInvalidArgument, "source_invalid",
                [&] { engine.Change("default", id, change); });
  }
}

TEST_F(EngineTest, RemovedIsGoneAtOnceAndAfterReopening) {
  {
    Engine engine(Options());
    AddMany(engine, 6);
    Train(engine);
    EXPECT_TRUE(engine.Remove("default", "p3"));
    EXPECT_FALSE(engine.Remove("default", "p3"));
    EXPECT_THAT(Ids(engine.Search(RandomPng(3), ByImage())), Not(::testing::Contains("p3")));
    ExpectError(ErrorCode::kNotFound, "image_not_found", [&] { engine.Get("default", "p3"); });
    EXPECT_EQ(engine.RemoveObject("default", "o1"), 2u);
    EXPECT_EQ(engine.RemoveObject("default", "o1"), 0u);
    EXPECT_THAT(engine.Check(), IsEmpty());
  }
  Engine engine(Options());
  EXPECT_EQ(engine.Stats().images, 3u);
  EXPECT_EQ(engine.Stats().objects, 2u);
  EXPECT_EQ(engine.Search(RandomPng(3), ByImage(0)).hits.size(), 3u);
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineTest, DeletedBytesLeaveTheFile) {
  const std::vector<std::uint8_t> png = RandomPng(7);
  const auto occurs = [&] {
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
      const std::vector<std::uint8_t> file = ReadBytes(entry.path());
      const auto probe = std::vector<std::uint8_t>(png.begin() + 100, png.begin() + 200);
      if (std::search(file.begin(), file.end(), probe.begin(), probe.end()) != file.end())
        return true;
    }
    return false;
  };
  Engine engine(Options());
  for (std::uint64_t i = 20; i < 40; ++i) Add(engine, RandomPng(i), "o", "p" + std::to_string(i));
  Add(engine, png, "secret", "secret");
  ASSERT_TRUE(occurs());
  const std::uint64_t size = engine.Stats().database_bytes;
  EXPECT_TRUE(engine.Remove("default", "secret"));
  EXPECT_FALSE(occurs());
  EXPECT_EQ(engine.RemoveObject("default", "o"), 20u);
  EXPECT_LT(engine.Stats().database_bytes, size / 2) << "pages go back to the file system";
}

TEST_F(EngineTest, ListsComeInPages) {
  Engine engine(Options());
  AddMany(engine, 7);
  ImageListing list;
  list.limit = 3;
  std::vector<std::string> ids;
  while (true) {
    const ImagePage page = engine.ListPage(list);
    EXPECT_LE(page.records.size(), 3u);
    for (const ImageRecord& record : page.records) ids.push_back(record.id);
    if (!page.next) break;
    list.after = *page.next;
  }
  EXPECT_THAT(ids, ElementsAre("p1", "p2", "p3", "p4", "p5", "p6", "p7"));
  ImageListing of_object;
  of_object.which.object = "o2";
  EXPECT_EQ(engine.ListPage(of_object).records.size(), 2u);
  of_object.which.object = "unknown";
  EXPECT_THAT(engine.ListPage(of_object).records, IsEmpty());
  ObjectListing of_objects;
  of_objects.limit = 2;
  of_objects.after = engine.ListPage(of_objects).next.value();
  const std::vector<ListedObject> objects = engine.ListPage(of_objects).records;
  ASSERT_EQ(objects.size(), 2u);
  EXPECT_EQ(objects[0].record.object, "o3");
  EXPECT_EQ(objects[0].record.images, 2u);
  EXPECT_EQ(objects[1].record.images, 1u);
  list.limit = 0;
  ExpectError(ErrorCode::kInvalidArgument, "limit_invalid", [&] { engine.ListPage(list); });
}

TEST_F(EngineTest, CollectionsKeepApart) {
  Engine engine(Options());
  EXPECT_TRUE(engine.CreateCollection("second"));
  EXPECT_FALSE(engine.CreateCollection("second"));
  EXPECT_THAT(engine.ListCollections(), ElementsAre("default", "second"));
  AddMany(engine, 4);
  AddRequest request;
  request.collection = "second";
  const std::vector<std::uint8_t> png = RandomPng(1);
  request.bytes = png;
  request.object = "x";
  const int calls = descriptor_->calls;
  EXPECT_EQ(engine.Add(request).outcome, AddOutcome::kCreated);
  EXPECT_EQ(descriptor_->calls, calls) << "features are shared between collections";
  Train(engine);
  TrainOptions train;
  train.collection = "second";
  train.words = 10;
  engine.TrainVocabulary(train);
  SearchOptions options;
  options.collection = "second";
  EXPECT_EQ(engine.Search(png, options).hits.size(), 1u);
  EXPECT_EQ(engine.Search(png, {}).hits.size(), 2u);
  EXPECT_THAT(engine.Check(), IsEmpty());
  ExpectError(ErrorCode::kConflict, "collection_permanent",
              [&] { engine.RemoveCollection("default"); });
  ExpectError(ErrorCode::kInvalidArgument, "collection_invalid",
              [&] { engine.CreateCollection("a/b"); });
  EXPECT_TRUE(engine.RemoveCollection("second"));
  EXPECT_FALSE(engine.RemoveCollection("second"));
  ExpectError(ErrorCode::kNotFound, "collection_not_found", [&] { engine.Search(png, options); });
  EXPECT_EQ(engine.Search(png, {}).hits.size(), 2u);
  EXPECT_THAT(engine.Check(), IsEmpty());
}

}  // namespace
}  // namespace pliant::testing
