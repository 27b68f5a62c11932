// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/engine.h"

#include <algorithm>
#include <atomic>
#include <thread>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/sha256.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_pictures.h"

namespace pliant {
namespace {

using ::testing::ElementsAre;
using testing::ExpectError;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using testing::OtherViewPng;
using testing::RandomPng;
using testing::TemporaryFolder;

// Counts how often it is asked, so that tests see which work was not done.
class CountingDescriptor : public Descriptor {
 public:
  explicit CountingDescriptor(std::shared_ptr<const Descriptor> inner) : inner_(std::move(inner)) {}
  const DescriptorInfo& info() const override { return inner_->info(); }
  Descriptors Describe(const Image& grey, std::span<const Keypoint> keypoints,
                       int threads) const override {
    ++calls;
    return inner_->Describe(grey, keypoints, threads);
  }
  mutable std::atomic<int> calls{0};

 private:
  std::shared_ptr<const Descriptor> inner_;
};

class EngineTest : public ::testing::Test {
 protected:
  EngineOptions Options() {
    EngineOptions options;
    options.database = folder_ / "a.db";
    options.descriptor = "rootsift";
    options.custom_descriptor = descriptor_;
    options.busy_timeout_ms = 300;
    options.keep_originals = true;
    return options;
  }
  static AddResult Add(Engine& engine, const std::vector<std::uint8_t>& bytes,
                       const std::string& object, std::optional<std::string> id = {},
                       const std::string& metadata = "{}") {
    AddRequest request;
    request.bytes = bytes;
    request.object = object;
    request.id = std::move(id);
    request.metadata = metadata;
    request.source = "somewhere/" + object;
    return engine.Add(request);
  }
  // Pictures 1..count, two views an object: o1 = {1, 2}, o2 = {3, 4}...
  void AddMany(Engine& engine, int count) {
    for (int i = 1; i <= count; ++i) {
      Add(engine, RandomPng(static_cast<std::uint64_t>(i)), "o" + std::to_string((i + 1) / 2),
          "p" + std::to_string(i));
    }
  }
  static VocabularyRecord Train(Engine& engine, int words = 100, std::uint64_t seed = 1) {
    TrainOptions train;
    train.words = words;
    train.sample = 2000;
    train.seed = seed;
    return engine.TrainVocabulary(train);
  }
  static std::vector<std::string> Ids(const SearchResult& result) {
    std::vector<std::string> ids;
    for (const Hit& hit : result.hits) ids.push_back(hit.image_id);
    return ids;
  }
  static SearchOptions ByImage(std::size_t limit = 10) {
    SearchOptions options;
    options.group_by = GroupBy::kImage;
    options.limit = limit;
    return options;
  }

  TemporaryFolder folder_;
  std::shared_ptr<CountingDescriptor> descriptor_ =
      std::make_shared<CountingDescriptor>(MakeDescriptor("rootsift"));
};

TEST_F(EngineTest, ANewPictureIsStoredWithAllThatIsKnownOfIt) {
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
  ASSERT_EQ(descriptor_->calls, 1);
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
  EXPECT_EQ(descriptor_->calls, 1);
  EXPECT_EQ(engine.GetFeatures("default", "twin").keypoints,
            engine.GetFeatures("default", id).keypoints);
  // Other bytes under a known id.
  EXPECT_EQ(Add(engine, RandomPng(2), "cup", "twin").outcome, AddOutcome::kReplaced);
  EXPECT_EQ(descriptor_->calls, 2);
  EXPECT_EQ(engine.Stats().images, 2u);
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineTest, WhatIsNoPictureIsRefusedAndLeavesNothing) {
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
  for (const std::string object : {"a\nb", "\xc3\x28", "\xed\xa0\x80", "\xf5\x80\x80\x80"}) {
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
  AddRequest request;
  request.bytes = png;
  request.collection = "nowhere";
  ExpectError(ErrorCode::kNotFound, "collection_not_found", [&] { engine.Add(request); });
  EXPECT_EQ(Add(engine, png, "Tasse \xc3\xa4\xf0\x9f\x98\x80").outcome, AddOutcome::kCreated);
}

TEST_F(EngineTest, AnOtherViewFindsItsObject) {
  Engine engine(Options());
  for (std::uint64_t i = 1; i <= 12; ++i) Add(engine, RandomPng(i), "o" + std::to_string(i));
  ExpectError(ErrorCode::kConflict, "no_vocabulary", [&] { engine.Search(RandomPng(1), {}); });
  const VocabularyRecord vocabulary = Train(engine, 200);
  EXPECT_TRUE(vocabulary.active) << "the first one is used at once";
  for (const RankMethod method : {RankMethod::kTfIdf, RankMethod::kHistogram}) {
    for (std::uint64_t i = 1; i <= 12; ++i) {
      SearchOptions options;
      options.rank = method;
      const SearchResult result = engine.Search(OtherViewPng(i), options);
      ASSERT_FALSE(result.hits.empty());
      EXPECT_EQ(result.hits[0].object, "o" + std::to_string(i));
      EXPECT_EQ(result.hits[0].rank, 1u);
      EXPECT_EQ(result.vocabulary, vocabulary.id);
      EXPECT_EQ(result.words, 200u);
    }
  }
}

TEST_F(EngineTest, ItselfScoresOneAndComesByIdToo) {
  Engine engine(Options());
  AddMany(engine, 6);
  Train(engine);
  for (const RankMethod method : {RankMethod::kTfIdf, RankMethod::kHistogram}) {
    SearchOptions options = ByImage();
    options.rank = method;
    const SearchResult by_bytes = engine.Search(RandomPng(3), options);
    const SearchResult by_id = engine.SearchStored("p3", options);
    EXPECT_EQ(by_bytes.hits[0].image_id, "p3");
    EXPECT_NEAR(by_bytes.hits[0].score, 1, 1e-6);
    EXPECT_EQ(Ids(by_bytes), Ids(by_id));
  }
  ExpectError(ErrorCode::kNotFound, "image_not_found",
              [&] { engine.SearchStored("p99", ByImage()); });
}

TEST_F(EngineTest, PagesObjectsScoresAndRegions) {
  Engine engine(Options());
  AddMany(engine, 8);
  Add(engine, RandomPng(50), "", "nameless-1");
  Add(engine, RandomPng(51), "", "nameless-2");
  Train(engine);
  const SearchResult all = engine.Search(RandomPng(1), ByImage(0));
  EXPECT_EQ(all.hits.size(), 10u);
  EXPECT_EQ(all.total, 10u);
  SearchOptions page = ByImage(3);
  page.offset = 4;
  const SearchResult second = engine.Search(RandomPng(1), page);
  ASSERT_EQ(second.hits.size(), 3u);
  EXPECT_EQ(second.hits[0].rank, 5u);
  EXPECT_EQ(second.hits[0].image_id, all.hits[4].image_id);
  EXPECT_EQ(second.total, 10u);

  SearchOptions grouped;
  grouped.limit = 0;
  const SearchResult objects = engine.Search(RandomPng(1), grouped);
  EXPECT_EQ(objects.hits.size(), 6u) << "four objects and two pictures without one";
  EXPECT_EQ(objects.hits[0].image_id, all.hits[0].image_id);
  EXPECT_EQ(objects.hits[0].score, all.hits[0].score);

  SearchOptions only = ByImage();
  only.object = "o2";
  EXPECT_THAT(Ids(engine.Search(RandomPng(3), only)), ElementsAre("p3", "p4"));
  only.object = "";
  EXPECT_EQ(engine.Search(RandomPng(3), only).hits.size(), 2u);
  only.object = "never heard of";
  EXPECT_THAT(engine.Search(RandomPng(3), only).hits, IsEmpty());
  SearchOptions strict = ByImage();
  strict.min_score = 0.999;
  EXPECT_THAT(Ids(engine.Search(RandomPng(3), strict)), ElementsAre("p3"));

  SearchOptions region = ByImage();
  region.region = Region{0, 0, 80, 120};
  const SearchResult half = engine.Search(RandomPng(3), region);
  EXPECT_LT(half.keypoints, all.keypoints);
  EXPECT_EQ(half.hits[0].image_id, "p3");
  std::uint32_t inside = 0;
  for (const Keypoint& k : engine.GetFeatures("default", "p3").keypoints)
    inside += k.x < 80 ? 1 : 0;
  EXPECT_EQ(half.keypoints, inside);
}

TEST_F(EngineTest, BadSearchesSayWhatIsWrong) {
  Engine engine(Options());
  AddMany(engine, 2);
  Train(engine, 10);
  SearchOptions options;
  options.region = Region{0, 0, 0, 10};
  ExpectError(ErrorCode::kInvalidArgument, "region_invalid",
              [&] { engine.Search(RandomPng(1), options); });
  options.region = Region{0, 0, 1, 1};
  ExpectError(ErrorCode::kUnprocessable, "too_few_features",
              [&] { engine.Search(RandomPng(1), options); });
  options = {};
  options.min_score = 2;
  ExpectError(ErrorCode::kInvalidArgument, "min_score_invalid",
              [&] { engine.Search(RandomPng(1), options); });
  options = {};
  options.collection = "nowhere";
  ExpectError(ErrorCode::kNotFound, "collection_not_found",
              [&] { engine.Search(RandomPng(1), options); });
  ExpectError(ErrorCode::kUnprocessable, "image_empty",
              [&] { engine.Search({}, SearchOptions{}); });
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
      const std::vector<std::uint8_t> file = testing::ReadBytes(entry.path());
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
  ListOptions list;
  list.limit = 3;
  std::vector<std::string> ids;
  while (true) {
    const std::vector<ImageRecord> page = engine.List(list);
    if (page.empty()) break;
    EXPECT_LE(page.size(), 3u);
    for (const ImageRecord& record : page) ids.push_back(record.id);
    list.after_id = ids.back();
  }
  EXPECT_THAT(ids, ElementsAre("p1", "p2", "p3", "p4", "p5", "p6", "p7"));
  ListOptions of_object;
  of_object.object = "o2";
  EXPECT_EQ(engine.List(of_object).size(), 2u);
  of_object.object = "unknown";
  EXPECT_THAT(engine.List(of_object), IsEmpty());
  const std::vector<ObjectRecord> objects = engine.ListObjects("default", "o2", 10);
  ASSERT_EQ(objects.size(), 2u);
  EXPECT_EQ(objects[0].object, "o3");
  EXPECT_EQ(objects[0].images, 2u);
  EXPECT_EQ(objects[1].images, 1u);
  list.limit = 0;
  ExpectError(ErrorCode::kInvalidArgument, "limit_invalid", [&] { engine.List(list); });
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

TEST_F(EngineTest, VocabulariesAreVersionsAndSwitch) {
  Engine engine(Options());
  ExpectError(ErrorCode::kConflict, "no_pictures", [&] { Train(engine); });
  AddMany(engine, 6);
  const VocabularyRecord first = Train(engine, 50);
  const VocabularyRecord second = Train(engine, 80, 2);
  EXPECT_TRUE(first.active);
  EXPECT_FALSE(second.active);
  EXPECT_EQ(engine.Search(RandomPng(1), {}).words, 50u);
  Add(engine, RandomPng(9), "late", "late");  // has no words of the second one yet
  engine.UseVocabulary("default", second.id);
  EXPECT_EQ(engine.Search(RandomPng(1), {}).words, 80u);
  EXPECT_EQ(engine.Search(RandomPng(9), ByImage()).hits[0].image_id, "late");
  EXPECT_EQ(engine.Stats().vocabulary->id, second.id);
  const std::vector<VocabularyRecord> list = engine.ListVocabularies("default");
  ASSERT_EQ(list.size(), 2u);
  EXPECT_FALSE(list[0].active);
  EXPECT_TRUE(list[1].active);
  EXPECT_EQ(list[1].origin.seed, 2u);
  EXPECT_EQ(list[1].origin.method, "fasterpam");
  ExpectError(ErrorCode::kNotFound, "vocabulary_not_found",
              [&] { engine.UseVocabulary("default", 99); });
  EXPECT_THAT(engine.Check(), IsEmpty());
  engine.UseVocabulary("default", first.id);
  EXPECT_EQ(engine.Search(RandomPng(9), ByImage()).hits[0].image_id, "late");
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineTest, TheSameSeedGivesTheSameVocabularyInAnyOrderOfAdding) {
  double loss = 0;
  for (const bool reversed : {false, true}) {
    EngineOptions options = Options();
    options.database = folder_ / (reversed ? "r.db" : "f.db");
    Engine engine(options);
    for (int i = 1; i <= 6; ++i) {
      Add(engine, RandomPng(static_cast<std::uint64_t>(reversed ? 7 - i : i)), "x");
    }
    TrainOptions train;
    train.words = 20;
    train.sample = 300;
    const VocabularyRecord record = engine.TrainVocabulary(train);
    EXPECT_EQ(record.origin.sampled, 300u);
    if (reversed) {
      EXPECT_EQ(record.origin.loss, loss);
    }
    loss = record.origin.loss;
  }
}

TEST_F(EngineTest, TheNumberOfWordsIsChosenFromTheSample) {
  Engine engine(Options());
  AddMany(engine, 4);
  TrainOptions train;
  train.sample = 200;
  EXPECT_EQ(engine.TrainVocabulary(train).words, 20u);
  train.words = 201;
  ExpectError(ErrorCode::kInvalidArgument, "words_invalid", [&] { engine.TrainVocabulary(train); });
  train.words = -1;
  ExpectError(ErrorCode::kInvalidArgument, "words_invalid", [&] { engine.TrainVocabulary(train); });
  train.words = 65'537;
  ExpectError(ErrorCode::kInvalidArgument, "words_invalid", [&] { engine.TrainVocabulary(train); });
  train.words = 5;
  train.sample = -1;
  ExpectError(ErrorCode::kInvalidArgument, "sample_invalid",
              [&] { engine.TrainVocabulary(train); });
}

TEST_F(EngineTest, ACancelledTrainingLeavesNothing) {
  Engine engine(Options());
  AddMany(engine, 4);
  std::stop_source stop;
  TrainOptions train;
  train.words = 50;
  train.stop = stop.get_token();
  train.progress = [&](double, double) { stop.request_stop(); };
  ExpectError(ErrorCode::kCancelled, "", [&] { engine.TrainVocabulary(train); });
  EXPECT_THAT(engine.ListVocabularies("default"), IsEmpty());
  EXPECT_THAT(engine.Check(), IsEmpty());
}

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
          ASSERT_EQ(found.hits.at(0).image_id, id) << "an acknowledged picture is found at once";
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
      // The same bytes from two threads: one picture.
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
  // Removals that are too old are forgotten; whoever missed them must still not show the picture.
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

TEST_F(EngineTest, AnotherModelIsAConflict) {
  { Engine engine(Options()); }
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
  { Engine engine(Options()); }
  options.read_only = true;
  Engine engine(options);
  ExpectError(ErrorCode::kNoSpace, "read_only", [&] { Add(engine, RandomPng(1), "x"); });
}

TEST_F(EngineTest, BinaryDescriptorsWorkAlike) {
  EngineOptions options = Options();
  options.custom_descriptor = nullptr;
  options.descriptor = "orb";
  Engine engine(options);
  for (std::uint64_t i = 1; i <= 6; ++i) Add(engine, RandomPng(i), "o" + std::to_string(i));
  Train(engine, 60);
  for (std::uint64_t i = 1; i <= 6; ++i) {
    EXPECT_EQ(engine.Search(OtherViewPng(i), {}).hits[0].object, "o" + std::to_string(i));
  }
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
           "UPDATE features SET data = zeroblob(length(data)) WHERE picture = 1",
           "DELETE FROM features WHERE picture = 1",
           "UPDATE pictures SET keypoints = keypoints + 1 WHERE key = 1",
           "UPDATE pictures SET width = 1 WHERE key = 1",
           "DELETE FROM picture_words WHERE picture = 2",
           "UPDATE picture_words SET data = (SELECT data FROM picture_words WHERE picture = 2) "
           "WHERE picture = 1",
           "UPDATE picture_words SET data = x'00' WHERE picture = 1",
           "DELETE FROM vocabulary_words WHERE word = 7",
           "UPDATE vocabulary_words SET data = zeroblob(512) WHERE word = 7",
           "UPDATE vocabulary_words SET thresholds = NULL WHERE word = 7",
           "UPDATE vocabulary_words SET thresholds = NULL",
           "UPDATE vocabulary_words SET thresholds = zeroblob(256) WHERE word = 7",
           "UPDATE vocabulary_words SET thresholds = x'00' WHERE word = 7",
           "UPDATE vocabularies SET words = 3",
           "UPDATE vocabularies SET ready = 0",
           "UPDATE originals SET data = x'00' WHERE picture = 1",
           "INSERT INTO objects (collection, name) VALUES (1, 'lonely')",
           "UPDATE features SET model = 99 WHERE picture = 1",
           "UPDATE pictures SET metadata = '[1]' WHERE key = 1",
           "UPDATE pictures SET id = 'a b' WHERE key = 1",
           "UPDATE objects SET name = char(10) WHERE key = 1",
           "INSERT INTO removals (picture) VALUES (1)",
           "UPDATE sqlite_sequence SET seq = 0 WHERE name = 'pictures'",
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
  const std::vector<std::uint8_t> good = testing::ReadBytes(folder_ / "a.db");
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
    testing::WriteBytes(file, damaged);
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
}  // namespace pliant
