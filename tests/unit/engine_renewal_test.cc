// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Vocabularies that are switched under searches, and databases of older versions.
#include <atomic>
#include <map>
#include <thread>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>

#include "index/store/blob_bytes.h"
#include "index/store/word_codec.h"
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

// Makes of the database what the first version of Pliant left: schema 1, no thresholds, no
// signatures.
void Age(const std::filesystem::path& file) {
  SQLite::Database db(file.string(), SQLite::OPEN_READWRITE);
  SQLite::Statement rows(db, "SELECT key, data FROM picture_words");
  std::vector<std::pair<std::int64_t, std::vector<std::uint8_t>>> words;
  while (rows.executeStep()) {
    const SQLite::Column data = rows.getColumn(1);
    const auto* bytes = static_cast<const std::uint8_t*>(data.getBlob());
    Bow bow = DecodeBow({bytes, static_cast<std::size_t>(data.getBytes())}, kMaxWords);
    EXPECT_EQ(bow.signatures.size(), bow.words.size());
    bow.signatures.clear();
    bow.codes.clear();
    words.emplace_back(rows.getColumn(0).getInt64(), EncodeBow(bow));
  }
  for (const auto& [key, blob] : words) {
    SQLite::Statement update(db, "UPDATE picture_words SET data = ? WHERE key = ?");
    update.bind(1, blob.data(), static_cast<int>(blob.size()));
    update.bind(2, key);
    update.exec();
  }
  std::uint32_t checksum = 0;
  SQLite::Statement vocabulary(db, "SELECT data FROM vocabulary_words ORDER BY word");
  while (vocabulary.executeStep()) {
    const SQLite::Column data = vocabulary.getColumn(0);
    checksum = Crc32({static_cast<const std::uint8_t*>(data.getBlob()),
                      static_cast<std::size_t>(data.getBytes())},
                     checksum);
  }
  SQLite::Statement update(db, "UPDATE vocabularies SET checksum = ?");
  update.bind(1, static_cast<std::int64_t>(checksum));
  update.exec();
  db.exec("ALTER TABLE vocabulary_words DROP COLUMN thresholds");
  db.exec("ALTER TABLE vocabularies DROP COLUMN codebook");
  db.exec("ALTER TABLE models DROP COLUMN max_keypoints");
  db.exec("ALTER TABLE models DROP COLUMN max_side");
  for (const char* index : {"pictures_by_added", "pictures_by_updated"}) {
    db.exec(std::string("DROP INDEX ") + index);
  }
  db.exec("ALTER TABLE pictures DROP COLUMN updated_ms");
  for (const char* table : {"aliases", "repeatable_requests", "api_keys", "job_inputs", "job_items",
                            "jobs", "original_files", "originals_directory", "dropped_originals"}) {
    db.exec(std::string("DROP TABLE ") + table);
  }
  for (const char* trigger : {"picture_counted", "picture_uncounted", "object_counted",
                              "object_uncounted", "original_dropped"}) {
    db.exec(std::string("DROP TRIGGER IF EXISTS ") + trigger);
  }
  for (const char* column : {"automatic", "images", "objects", "descriptors", "display_name"}) {
    db.exec(std::string("ALTER TABLE collections DROP COLUMN ") + column);
  }
  db.exec("PRAGMA user_version = 1");
}

TEST_F(EngineOptionsTest, AnOldDatabaseAnswersAsBeforeUntilAVocabularyIsTrained) {
  SearchOptions options = ByImage();
  options.verify = Verification::kNone;
  const auto query = OtherViewPng(8);
  std::vector<double> expected;
  {
    Engine engine(Options());
    Fill(engine);
    options.tuning.signatures = false;
    options.rank = RankMethod::kTfIdf;
    for (const Hit& hit : engine.Search(query, options).hits) expected.push_back(hit.score);
  }
  Age(Options().database);
  EngineOptions reading = Options();
  reading.read_only = true;
  ExpectError(ErrorCode::kConflict, "old_schema", [&] { Engine engine(reading); });

  Engine engine(Options());
  EXPECT_THAT(engine.Check(), IsEmpty());
  options.tuning.signatures = true;        // there are none
  options.rank = RankMethod::kNeighbours;  // nor codes
  const SearchResult old = engine.Search(query, options);
  EXPECT_EQ(old.rank, RankMethod::kTfIdf);
  ASSERT_EQ(old.hits.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_NEAR(old.hits[i].score, expected[i], 1e-6);
  }
  const auto png = RandomPng(99);
  AddRequest request;
  request.bytes = png;
  request.id = "new";
  engine.Add(request);  // gets words without signatures, as the others have
  EXPECT_THAT(engine.Check(), IsEmpty());
  options.limit = 1;
  EXPECT_EQ(engine.Search(OtherViewPng(99), options).hits.at(0).image_id, "new");

  TrainOptions train;
  train.words = 60;
  train.sample = 3000;
  engine.UseVocabulary("default", engine.TrainVocabulary(train).id);
  EXPECT_THAT(engine.Check(), IsEmpty());
  const SearchResult renewed = engine.Search(query, options);
  EXPECT_EQ(renewed.vocabulary, 2);
  EXPECT_EQ(renewed.hits.at(0).image_id, "p8");
  EXPECT_EQ(renewed.rank, RankMethod::kNeighbours);
  options.rank = RankMethod::kTfIdf;
  const double with_signatures = engine.Search(query, options).hits.at(0).score;
  options.tuning.signatures = false;
  EXPECT_NE(engine.Search(query, options).hits.at(0).score, with_signatures);
}

}  // namespace
}  // namespace pliant::testing
