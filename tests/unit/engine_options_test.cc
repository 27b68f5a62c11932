// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a search can be asked for: filters, pages, instances; and databases of older versions.
#include <algorithm>
#include <atomic>
#include <map>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "index/blob_codec.h"
#include "index/engine.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_pictures.h"

namespace pliant {
namespace {

using ::testing::ElementsAre;
using testing::ExpectError;
using ::testing::IsEmpty;
using testing::OtherViewPng;
using testing::RandomPicture;
using testing::RandomPng;
using testing::TemporaryFolder;
using ::testing::UnorderedElementsAre;

class EngineOptionsTest : public ::testing::Test {
 protected:
  static constexpr int kPictures = 12;

  EngineOptions Options() {
    EngineOptions options;
    options.database = folder_ / "a.db";
    options.descriptor = "rootsift";
    return options;
  }
  // Pictures p1..p12 of objects o0..o3 in turn, of the years 2001..2012, in the shops east and
  // west.
  static void Fill(Engine& engine) {
    for (int i = 1; i <= kPictures; ++i) {
      const auto png = RandomPng(static_cast<std::uint64_t>(i));
      AddRequest request;
      request.bytes = png;
      request.id = "p" + std::to_string(i);
      request.object = "o" + std::to_string(i % 4);
      request.metadata = "{\"year\": " + std::to_string(2000 + i) + ", \"shop\": \"" +
                         (i % 3 == 0 ? "west" : "east") + "\"}";
      engine.Add(request);
    }
    TrainOptions train;
    train.words = 60;
    train.sample = 3000;
    engine.TrainVocabulary(train);
  }
  static SearchOptions ByImage() {
    SearchOptions options;
    options.group_by = GroupBy::kImage;
    options.limit = 0;
    return options;
  }
  static std::vector<std::string> Ids(const SearchResult& result) {
    std::vector<std::string> ids;
    for (const Hit& hit : result.hits) ids.push_back(hit.image_id);
    return ids;
  }

  TemporaryFolder folder_;
};

TEST_F(EngineOptionsTest, OnlyPicturesThatPassTheFilterAreHits) {
  Engine engine(Options());
  Fill(engine);
  const auto query = OtherViewPng(6);
  for (const Verification verify : {Verification::kNone, Verification::kTps}) {
    SearchOptions options = ByImage();
    options.verify = verify;
    const SearchResult all = engine.Search(query, options);
    EXPECT_EQ(all.hits.at(0).image_id, "p6");
    options.filter = ParseFilter(R"({"shop": "east", "year": {"gt": 2003, "lte": 2008}})");
    const SearchResult some = engine.Search(query, options);
    EXPECT_THAT(Ids(some), UnorderedElementsAre("p4", "p5", "p7", "p8"));
    EXPECT_EQ(some.total, 4U);
    // The others have the scores that they had.
    std::map<std::string, double> before;
    for (const Hit& hit : all.hits) before[hit.image_id] = hit.score;
    for (const Hit& hit : some.hits) EXPECT_EQ(hit.score, before.at(hit.image_id));
    options.object = "o0";
    EXPECT_THAT(Ids(engine.Search(query, options)), UnorderedElementsAre("p4", "p8"));
    options.object = "nobody";
    EXPECT_THAT(Ids(engine.Search(query, options)), IsEmpty());
    options.object.reset();
    options.group_by = GroupBy::kObject;
    EXPECT_EQ(engine.Search(query, options).total, 3U);  // o0, o1, o3
    options.filter = ParseFilter(R"({"year": 1999})");
    EXPECT_EQ(engine.Search(query, options).total, 0U);
  }
  SearchOptions options;
  options.filter.conditions.push_back({"year", {}, {}, {}});
  ExpectError(ErrorCode::kInvalidArgument, "filter_invalid",
              [&] { engine.Search(query, options); });
}

TEST_F(EngineOptionsTest, PagesFitTogetherWhateverIsVerified) {
  Engine engine(Options());
  Fill(engine);
  const auto query = OtherViewPng(7);
  for (const GroupBy group_by : {GroupBy::kImage, GroupBy::kObject}) {
    for (const std::size_t depth : {0U, 1U, 5U}) {
      SearchOptions options = ByImage();
      options.group_by = group_by;
      options.verify_depth = depth;
      const SearchResult all = engine.Search(query, options);
      EXPECT_EQ(all.hits.at(0).image_id, "p7");
      EXPECT_EQ(all.total, all.hits.size());
      options.limit = 2;
      std::vector<std::string> pages;
      for (; options.offset < all.total; options.offset += 2) {
        const SearchResult page = engine.Search(query, options);
        EXPECT_EQ(page.total, all.total);
        ASSERT_FALSE(page.hits.empty());
        EXPECT_EQ(page.hits[0].rank, options.offset + 1);
        for (const std::string& id : Ids(page)) pages.push_back(id);
      }
      EXPECT_EQ(pages, Ids(all));
      EXPECT_TRUE(std::is_sorted(all.hits.begin(), all.hits.end(),
                                 [](const Hit& a, const Hit& b) { return a.score > b.score; }));
    }
  }
}

TEST_F(EngineOptionsTest, AnObjectThatIsThereTwiceIsFoundTwice) {
  Engine engine(Options());
  Fill(engine);
  const Image one = RandomPicture(5);
  Image both{3 * one.width, one.height, 1, {}};
  both.pixels.assign(static_cast<std::size_t>(both.width) * both.height, 128);
  for (int y = 0; y < one.height; ++y) {
    for (int x = 0; x < one.width; ++x) {
      const auto grey = one.pixels[static_cast<std::size_t>(y) * one.width + x];
      both.pixels[static_cast<std::size_t>(y) * both.width + x] = grey;
      both.pixels[static_cast<std::size_t>(y) * both.width + 2 * one.width + x] = grey;
    }
  }
  const auto query = EncodePng(both);
  SearchOptions options = ByImage();
  const Hit hit = engine.Search(query, options).hits.at(0);
  EXPECT_EQ(hit.image_id, "p5");
  ASSERT_EQ(hit.instances.size(), 2U);
  EXPECT_EQ(hit.instances[0].inliers, hit.inliers);
  EXPECT_GE(hit.instances[1].inliers, 10);
  std::set<bool> right;
  for (const Instance& instance : hit.instances) {
    ASSERT_GE(instance.polygon.size(), 3U);
    double x = 0;
    for (const Point& p : instance.polygon) x += p.x / static_cast<double>(instance.polygon.size());
    right.insert(x > 1.5 * one.width);
    EXPECT_NEAR(x, x > 1.5 * one.width ? 2.5 * one.width : 0.5 * one.width, 15);
  }
  EXPECT_EQ(right.size(), 2U);
  options.max_instances = 1;
  EXPECT_EQ(engine.Search(query, options).hits.at(0).instances.size(), 1U);
  // What is there once is found once.
  options.max_instances = 4;
  EXPECT_EQ(engine.Search(OtherViewPng(5), options).hits.at(0).instances.size(), 1U);
  options.max_instances = 0;
  ExpectError(ErrorCode::kInvalidArgument, "max_instances_invalid",
              [&] { engine.Search(query, options); });
}

TEST_F(EngineOptionsTest, SeveralWordsADescriptorAndNoSignatures) {
  Engine engine(Options());
  Fill(engine);
  const auto query = OtherViewPng(9);
  SearchOptions options = ByImage();
  options.verify = Verification::kNone;
  const SearchResult plain = engine.Search(query, options);
  EXPECT_EQ(plain.hits.at(0).image_id, "p9");
  options.tuning.assignments = 3;
  EXPECT_EQ(engine.Search(query, options).hits.at(0).image_id, "p9");
  options.tuning.signatures = false;
  const SearchResult words = engine.Search(query, options);
  EXPECT_EQ(words.hits.at(0).image_id, "p9");
  // Signatures tell pictures apart that have the same words.
  options.tuning.assignments = 1;
  const SearchResult cosine = engine.Search(query, options);
  EXPECT_GT(plain.hits[0].score / plain.hits[1].score, cosine.hits[0].score / cosine.hits[1].score);
  options.tuning.assignments = 17;
  ExpectError(ErrorCode::kInvalidArgument, "tuning.assignments_invalid",
              [&] { engine.Search(query, options); });
}

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
  db.exec("ALTER TABLE models DROP COLUMN max_keypoints");
  db.exec("ALTER TABLE models DROP COLUMN max_side");
  db.exec("DROP TABLE api_keys");
  db.exec("DROP TABLE jobs");
  for (const char* table : {"original_files", "originals_directory", "dropped_originals"}) {
    db.exec(std::string("DROP TABLE ") + table);
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
    for (const Hit& hit : engine.Search(query, options).hits) expected.push_back(hit.score);
  }
  Age(Options().database);
  EngineOptions reading = Options();
  reading.read_only = true;
  ExpectError(ErrorCode::kConflict, "old_schema", [&] { Engine engine(reading); });

  Engine engine(Options());
  EXPECT_THAT(engine.Check(), IsEmpty());
  options.tuning.signatures = true;  // there are none
  const SearchResult old = engine.Search(query, options);
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
  options.tuning.signatures = false;
  EXPECT_NE(engine.Search(query, options).hits.at(0).score, renewed.hits.at(0).score);
}

}  // namespace
}  // namespace pliant
