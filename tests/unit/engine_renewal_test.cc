// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Vocabularies that are switched under searches.
#include <atomic>
#include <map>
#include <thread>

#include "tests/unit/engine_options_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::IsEmpty;

TEST_F(EngineOptionsTest, SearchesGoOnWhileAVocabularyIsTrainedAndSwitched) {
  Engine engine(Options());
  Fill(engine);
  const auto query = OtherViewPng(11);
  std::atomic<bool> done{false};
  std::map<std::int64_t, int> answers;  // by vocabulary
  std::thread searcher([&] {
    SearchOptions options;
    options.threads = 1;
    while (!done) {
      const SearchResult result = engine.Search(query, options);
      ++answers[result.vocabulary];
      ASSERT_FALSE(result.hits.empty());
      EXPECT_EQ(result.hits[0].image_id, "p11");
      EXPECT_EQ(result.words, result.vocabulary == 1 ? 60U : 90U);
    }
  });
  TrainOptions train;
  train.words = 90;
  train.sample = 3000;
  const VocabularyRecord trained = engine.TrainVocabulary(train);
  EXPECT_FALSE(trained.active);
  EXPECT_EQ(engine.Search(query, {}).vocabulary, 1);
  engine.UseVocabulary("default", trained.id);
  EXPECT_EQ(engine.Search(query, {}).vocabulary, trained.id);
  engine.UseVocabulary("default", 1);  // and back
  EXPECT_EQ(engine.Search(query, {}).vocabulary, 1);
  engine.UseVocabulary("default", trained.id);
  EXPECT_EQ(engine.Search(query, {}).vocabulary, trained.id);
  done = true;
  searcher.join();
  EXPECT_GT(answers[1], 0);
  EXPECT_LE(answers.size(), 2U);
  EXPECT_THAT(engine.Check(), IsEmpty());
}

}  // namespace
}  // namespace pliant::testing
