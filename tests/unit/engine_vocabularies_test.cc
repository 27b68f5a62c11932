// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Training and choosing vocabularies.
#include <stop_token>
#include <vector>

#include "index/engine/training_policy.h"
#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::IsEmpty;

TEST_F(EngineTest, VocabulariesAreVersionsAndSwitch) {
  Engine engine(Options());
  ExpectError(ErrorCode::kConflict, "no_images", [&] { Train(engine); });
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

void AddShirts(Engine& engine, std::uint64_t last, std::uint64_t first = 1) {
  AddRequest request;
  request.collection = "shirts";
  for (std::uint64_t seed = first; seed <= last; ++seed) {
    const std::vector<std::uint8_t> png = RandomPng(seed);
    request.bytes = png;
    engine.Add(request);
  }
}

// A collection of six images, and how to train a small vocabulary for it.
TrainOptions Shirts(Engine& engine) {
  engine.CreateCollection("shirts");
  AddShirts(engine, 6);
  TrainOptions train;
  train.collection = "shirts";
  train.words = 10;
  train.sample = 100;
  return train;
}

TEST_F(EngineTest, ACollectionThatIsRemovedWhileItTrains) {
  for (const double moment : {0.1, 0.8, 0.9, 1.0}) {
    for (const bool made_again : {false, true}) {
      Engine engine(Options());
      TrainOptions train = Shirts(engine);
      bool removed = false;
      train.progress = [&](double done, double /*loss*/) {
        if (removed || done < moment) return;
        removed = true;
        engine.RemoveCollection("shirts");
        if (made_again) engine.CreateCollection("shirts");
      };
      ExpectError(ErrorCode::kNotFound, "collection_not_found",
                  [&] { engine.TrainVocabulary(train); });
      ASSERT_TRUE(removed) << moment;
      EXPECT_THAT(engine.Check(), IsEmpty());
      engine.RemoveCollection("shirts");
    }
  }
}

TEST_F(EngineTest, ACollectionThatIsRemovedWhileItsVocabularyIsSwitched) {
  Engine engine(Options());
  TrainOptions train = Shirts(engine);
  engine.TrainVocabulary(train);
  train.seed = 2;
  const VocabularyRecord second = engine.TrainVocabulary(train);
  AddShirts(engine, 9, 9);  // has no words of it yet
  UseOptions options;
  options.progress = [&](double /*done*/) {
    if (engine.RemoveCollection("shirts")) engine.CreateCollection("shirts");
  };
  ExpectError(ErrorCode::kNotFound, "collection_not_found",
              [&] { engine.UseVocabulary("shirts", second.id, options); });
  EXPECT_THAT(engine.Check(), IsEmpty());
}

TEST_F(EngineTest, TheSameSeedGivesTheSameVocabularyInAnyOrderOfAdding) {
  double loss = 0;
  for (const bool reversed : {false, true}) {
    EngineOptions options = Options();
    options.database = Database(folder_ / (reversed ? "r.db" : "f.db"));
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

TEST(VocabularySize, GrowsWithTheCollectionFromFourMillionDescriptorsOn) {
  EXPECT_EQ(DefaultVocabularySample(0), 40'000u);
  EXPECT_EQ(DefaultVocabularySample(4'000'000), 40'000u);
  EXPECT_EQ(DefaultVocabularySample(8'000'000), 80'000u);
  EXPECT_EQ(DefaultVocabularySample(70'000'000), 700'000u);
  EXPECT_EQ(DefaultVocabularySample(500'000'000), 2'621'440u);
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

}  // namespace
}  // namespace pliant::testing
