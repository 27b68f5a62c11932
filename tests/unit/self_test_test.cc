// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Collections that test themselves.
#include "index/selftest/self_test.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "descriptor/simulation/procedural.h"
#include "index/selftest/photographer.h"
#include "index/selftest/self_test_json.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_images.h"
#include "tests/unit/test_database.h"

namespace pliant {
namespace {

using simulation::PaintProcedural;
using simulation::ProceduralKind;
using testing::ExpectError;

std::vector<std::uint8_t> Picture(ProceduralKind kind, std::uint64_t seed, int quality = 90) {
  return EncodeJpeg(PaintProcedural(kind, seed, 400), quality);
}

class SelfTestTest : public ::testing::Test {
 protected:
  Engine Open(bool keep_originals = true) {
    EngineOptions options;
    options.database = testing::Database(folder_ / "a.db");
    options.descriptor = "rootsift";
    options.keep_originals = keep_originals;
    return Engine(options);
  }
  static void Add(Engine& engine, const std::string& object,
                  const std::vector<std::uint8_t>& bytes) {
    AddRequest request;
    request.id = "of-" + std::to_string(std::hash<std::string>()(object));
    request.object = object;
    request.bytes = bytes;
    engine.Add(request);
  }
  // Five pictures that resemble nothing else, with a vocabulary.
  static void AddPictures(Engine& engine) {
    Add(engine, "map", Picture(ProceduralKind::kMap, 1));
    Add(engine, "newspaper", Picture(ProceduralKind::kNewspaper, 2));
    Add(engine, "packet", Picture(ProceduralKind::kPackaging, 3));
    Add(engine, "flowers", Picture(ProceduralKind::kFloral, 4));
    Add(engine, "poster", Picture(ProceduralKind::kLettering, 5));
    TrainOptions train;
    train.words = 100;
    train.sample = 1000;
    engine.TrainVocabulary(train);
  }

  testing::TemporaryFolder folder_;
};

TEST_F(SelfTestTest, FindsItsOwnPictures) {
  Engine engine = Open();
  AddPictures(engine);
  std::uint64_t most = 0;
  SelfTestOptions options{.pictures = 8, .false_alarms = 0.2, .threads = 2};
  options.progress = [&](std::uint64_t done, std::uint64_t total) {
    EXPECT_EQ(total, 8U);
    most = std::max(most, done);
  };
  const SelfTestReport report = RunSelfTest(engine, options);
  EXPECT_EQ(most, 8U);
  EXPECT_EQ(report.images, 5U);
  ASSERT_EQ(report.photos.size(), 8U);
  const auto count = [&](SelfTestVerdict verdict) {
    return std::ranges::count(report.photos, verdict, &SelfTestPhoto::verdict);
  };
  EXPECT_GE(count(SelfTestVerdict::kFound), 6);
  EXPECT_EQ(count(SelfTestVerdict::kWrong), 0);
  EXPECT_EQ(std::ranges::count(report.photos, true, &SelfTestPhoto::false_alarm), 0);
  EXPECT_TRUE(report.similar.empty());
  // No alarm in eight photos: (1 + 0) / (8 + 1) is below the wanted rate from the lowest limit on.
  EXPECT_TRUE(report.reaches_rate);
  EXPECT_EQ(report.found_from, kLeastFoundFrom);
  for (std::size_t i = 0; i < 3; ++i) {  // each object once, then again in the same order
    EXPECT_EQ(report.photos[i].object, report.photos[i + 5].object);
    EXPECT_GT(report.photos[i].share, 0);
    EXPECT_NO_THROW(DecodeImage(report.photos[i].thumbnail));
  }
  // The same with another number of threads.
  const SelfTestReport again =
      RunSelfTest(engine, {.pictures = 2, .false_alarms = 0.2, .threads = 1});
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(again.photos[i].image_id, report.photos[i].image_id);
    EXPECT_EQ(again.photos[i].thumbnail, report.photos[i].thumbnail);
    EXPECT_EQ(again.photos[i].probability, report.photos[i].probability);
    EXPECT_EQ(again.photos[i].absent_probability, report.photos[i].absent_probability);
  }
}

TEST_F(SelfTestTest, NamesTwinsAndPlainImages) {
  Engine engine = Open();
  AddPictures(engine);
  const std::string old_map = "an old map, with a name of more than 15 characters";
  Add(engine, old_map, Picture(ProceduralKind::kMap, 1, 70));
  Image plain{400, 300, 1, std::vector<std::uint8_t>(std::size_t{400} * 300, 128)};
  for (int spot = 0; spot < 8; ++spot) {  // too little to recognise
    for (int y = 0; y < 12; ++y) {
      std::fill_n(plain.pixels.begin() + (40 + 20 * spot + y) * 400 + 40 * (spot + 1), 12, 20);
    }
  }
  Add(engine, "wall", EncodePng(plain));
  const SelfTestReport report = RunSelfTest(engine, {.pictures = 7});
  ASSERT_EQ(report.similar.size(), 1U);  // whichever of both was asked
  const SimilarObjects& twins = report.similar.front();
  EXPECT_THAT((std::vector{twins.object, twins.other}),
              ::testing::UnorderedElementsAre("map", old_map));
  EXPECT_EQ(twins.confused, std::ranges::count(report.photos, true, &SelfTestPhoto::false_alarm));
  EXPECT_FALSE(report.reaches_rate);
  EXPECT_EQ(report.found_from, kMostFoundFrom);
  ASSERT_EQ(report.plain.size(), 1U);
  EXPECT_EQ(report.plain.front().object, "wall");
}

TEST_F(SelfTestTest, RefusesWhatItCannotDo) {
  Engine engine = Open(/*keep_originals=*/false);
  const auto refuse = [&](ErrorCode code, const char* reason, const SelfTestOptions& options) {
    ExpectError(code, reason, [&] { RunSelfTest(engine, options); });
  };
  refuse(ErrorCode::kInvalidArgument, "option_out_of_range", {.pictures = 0});
  refuse(ErrorCode::kInvalidArgument, "option_out_of_range", {.pictures = 10'001});
  for (const double rate : {0.0, 1.0, std::numeric_limits<double>::quiet_NaN()}) {
    refuse(ErrorCode::kInvalidArgument, "option_out_of_range", {.false_alarms = rate});
  }
  refuse(ErrorCode::kNotFound, "collection_not_found", {.collection = "none"});
  refuse(ErrorCode::kConflict, "no_images", {});
  AddPictures(engine);
  refuse(ErrorCode::kNotFound, "content_not_kept", {.pictures = 2});
  SelfTestOptions stopped;
  std::stop_source stop;
  stop.request_stop();
  stopped.stop = stop.get_token();
  refuse(ErrorCode::kCancelled, "cancelled", stopped);
}

TEST_F(SelfTestTest, NeedsAVocabulary) {
  Engine engine = Open();
  Add(engine, "map", Picture(ProceduralKind::kMap, 1));
  ExpectError(ErrorCode::kConflict, "no_vocabulary", [&] { RunSelfTest(engine, {.pictures = 1}); });
}

TEST_F(SelfTestTest, TheLimitOfACollectionDecidesWhatIsFound) {
  Engine engine = Open();
  AddPictures(engine);
  const SimulatedPhoto photo =
      Photographer().Take(PaintProcedural(ProceduralKind::kMap, 1, 400), 0.3, 2);
  const auto search = [&] { return engine.Search(EncodeJpeg(photo.image), {}); };
  const SearchResult before = search();
  ASSERT_EQ(before.hits.front().object, "map");
  EXPECT_EQ(before.found_from, kFoundProbability);
  const double probability = *before.hits.front().probability;
  ASSERT_GE(probability, kFoundProbability);
  EXPECT_EQ(engine.ChangeCollection("default", {.found_from = 0.99}).found_from, 0.99);
  const SearchResult after = search();
  EXPECT_EQ(after.found_from, 0.99);
  EXPECT_EQ(after.found, probability >= 0.99 ? 1U : 0U);
  EXPECT_EQ(after.perhaps, probability < 0.99);
  for (const double limit : {0.49, 1.0, std::numeric_limits<double>::quiet_NaN()}) {
    ExpectError(ErrorCode::kInvalidArgument, "found_from_invalid",
                [&] { engine.ChangeCollection("default", {.found_from = limit}); });
  }
}

TEST(SelfTestJson, SharesHaveIntervals) {
  SelfTestReport report;
  report.images = 3;
  for (int i = 0; i < 10; ++i) {
    SelfTestPhoto photo;
    photo.image_id = "p" + std::to_string(i % 5);
    photo.strength = 0.5;
    photo.share = 0.04 * (1 + i % 2);
    photo.verdict = i < 8 ? SelfTestVerdict::kFound : SelfTestVerdict::kMissed;
    report.photos.push_back(photo);
  }
  const Json json = SelfTestJson(report, {}, /*examples=*/true);
  const Json& found = json["outcomes"]["found"];
  EXPECT_EQ(found["count"], 8);
  EXPECT_EQ(found["share"], 0.8);
  // Wilson's interval for 8 of 10, as tables have it.
  EXPECT_NEAR(found["low"].get<double>(), 0.490, 0.001);
  EXPECT_NEAR(found["high"].get<double>(), 0.943, 0.001);
  EXPECT_EQ(json["outcomes"]["wrong"]["low"], 0);
  EXPECT_EQ(json["by_strength"].size(), 1U);
  EXPECT_EQ(json["by_size"][0]["photos"], 5);  // a fifth of the width
  EXPECT_EQ(json["by_size"][1]["photos"], 5);
  EXPECT_TRUE(json["by_size"][2]["found"].is_null());
  EXPECT_EQ(json["missed"].size(), 2U);
  EXPECT_EQ(json["missed"][0]["photos"], 2);
  EXPECT_EQ(json["examples"].size(), 6U);  // four of the found ones
  EXPECT_FALSE(SelfTestJson(report, {}, /*examples=*/false).contains("examples"));
}

}  // namespace
}  // namespace pliant
