// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The experiment measures the product: its answers are those of an engine that is used by hand.
#include "index/evaluation/retrieval_evaluation.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_images.h"

namespace pliant {
namespace {

using testing::ExpectError;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::OtherViewPng;
using testing::RandomPng;
using testing::ReadBytes;
using ::testing::SizeIs;
using testing::TemporaryFolder;
using testing::WriteBytes;
using testing::WriteText;

class RetrievalEvaluationTest : public ::testing::Test {
 protected:
  static constexpr int kObjects = 6;

  // oN/ref.png, its view, and an image that shows something else but is said to show oN.
  RetrievalEvaluationTest() {
    for (std::uint64_t i = 1; i <= kObjects; ++i) {
      const std::string folder = "set/o" + std::to_string(i);
      WriteBytes(folder_ / (folder + "/ref.png"), OtherViewPng(i));
      WriteBytes(folder_ / (folder + "/1.png"), RandomPng(i));
      WriteBytes(folder_ / (folder + "/2.png"), RandomPng(100 + i));
    }
    options_.descriptors = {"rootsift"};
    options_.seeds = 2;
    options_.words = {20};
  }
  RetrievalSet Set(const std::vector<std::filesystem::path>& distractors = {}) {
    return ReadRetrievalSet(folder_ / "set", RetrievalLayout::kAuto, distractors);
  }
  // The mean over queries and seeds, from the public interface and encoded bytes only.
  RetrievalMetrics ByHand(SearchOptions search, int words, bool enlarge = true) {
    EngineOptions engine_options;
    engine_options.enlarge = enlarge;
    engine_options.database = folder_ / ("hand" + std::to_string(words) + ".db");
    engine_options.descriptor = "rootsift";
    Engine engine(engine_options);
    const RetrievalSet set = Set();
    for (const RetrievalImage& image : set.images) {
      if (!image.is_searched) continue;
      AddRequest request;
      const auto bytes = ReadBytes(image.path);
      request.bytes = bytes;
      request.object = image.object;
      engine.Add(request);
    }
    search.group_by = GroupBy::kImage;
    search.limit = 0;
    std::vector<RetrievalMetrics> all;
    for (std::uint64_t seed = 1; seed <= 2; ++seed) {
      TrainOptions train;
      train.words = words;
      train.seed = seed;
      engine.UseVocabulary(kDefaultCollection, engine.TrainVocabulary(train).id);
      for (const RetrievalImage& image : set.images) {
        if (!image.is_query) continue;
        RetrievalAnswer answer{{}, 2};
        const auto bytes = ReadBytes(image.path);
        for (const Hit& hit : engine.Search(bytes, search).hits)
          answer.right.push_back(hit.object == image.object);
        all.push_back(MeasureAnswer(answer));
      }
    }
    return Mean(all);
  }
  static void ExpectEqual(const RetrievalMetrics& a, const RetrievalMetrics& b) {
    for (std::size_t k = 0; k < kAccuracyRanks; ++k)
      EXPECT_NEAR(a.accuracy_at[k], b.accuracy_at[k], 1e-12) << "K = " << k + 1;
    EXPECT_NEAR(a.map, b.map, 1e-12);
    EXPECT_NEAR(a.mrr, b.mrr, 1e-12);
  }

  TemporaryFolder folder_;
  RetrievalOptions options_;
};

TEST_F(RetrievalEvaluationTest, EveryProtocolGivesWhatTheEngineGives) {
  options_.protocols = {RetrievalProtocol::kPaper, RetrievalProtocol::kDefault,
                        RetrievalProtocol::kUnverified};
  const RetrievalReport report = EvaluateRetrieval(Set(), options_);
  EXPECT_EQ(report.images, 2U * kObjects);
  EXPECT_EQ(report.queries, 1U * kObjects);
  EXPECT_EQ(report.objects, 1U * kObjects);
  EXPECT_EQ(report.distractors, 0U);
  EXPECT_THAT(report.skipped, IsEmpty());
  ASSERT_THAT(report.results, SizeIs(3));

  SearchOptions search;
  ExpectEqual(report.results[1].mean, ByHand(search, 20));
  search.verify = Verification::kNone;
  ExpectEqual(report.results[2].mean, ByHand(search, 20));
  search.rank = RankMethod::kHistogram;
  ExpectEqual(report.results[0].mean, ByHand(search, 10, false));  // the paper's

  EXPECT_EQ(report.results[0].words, 10U);
  EXPECT_EQ(report.results[1].words, 20U);
  for (const RetrievalResult& row : report.results) {
    EXPECT_EQ(row.descriptor, "rootsift");
    EXPECT_FALSE(row.ns_score.has_value());
    ASSERT_TRUE(row.object.has_value());
    EXPECT_GT(row.times.detect, 0);
    EXPECT_GT(row.times.rank, 0);
    EXPECT_GT(row.stored_bytes_per_image, 1000);
    EXPECT_GT(row.index_bytes_per_image, 0);
  }
  // The true view comes first, the stranger that bears the object's name does not.
  EXPECT_DOUBLE_EQ(report.results[1].object->top1, 1);
  EXPECT_DOUBLE_EQ(report.results[1].mean.top1, 1);
  EXPECT_LT(report.results[1].mean.map, 1);
  EXPECT_GT(report.results[1].times.verify, 0);
  EXPECT_EQ(report.results[2].times.verify, 0);
}

TEST_F(RetrievalEvaluationTest, AQueryIsNoAnswerToItselfUnlessTheLayoutSaysSo) {
  for (std::uint64_t i = 0; i < 8; ++i) {
    WriteBytes(folder_ / ("bench/ukbench0000" + std::to_string(i) + ".png"),
               i % 2 == 0 ? RandomPng(i / 4) : OtherViewPng(i / 4));
  }
  options_.protocols = {RetrievalProtocol::kDefault};
  const RetrievalReport report =
      EvaluateRetrieval(ReadRetrievalSet(folder_ / "bench", RetrievalLayout::kAuto), options_);
  EXPECT_EQ(report.queries, 8U);  // images with the same bytes count each
  ASSERT_TRUE(report.results[0].ns_score.has_value());
  EXPECT_DOUBLE_EQ(*report.results[0].ns_score, 4);
  EXPECT_FALSE(report.results[0].object.has_value());

  for (std::uint64_t i = 1; i <= 3; ++i) {
    const std::string folder = "others/o" + std::to_string(i);
    WriteBytes(folder_ / (folder + "/a.png"), RandomPng(i));
    WriteBytes(folder_ / (folder + "/b.png"), OtherViewPng(i));
  }
  const RetrievalReport others =
      EvaluateRetrieval(ReadRetrievalSet(folder_ / "others", RetrievalLayout::kAuto), options_);
  EXPECT_EQ(others.queries, 6U);
  EXPECT_DOUBLE_EQ(others.results[0].mean.accuracy_at[0], 1);
  EXPECT_DOUBLE_EQ(others.results[0].mean.accuracy_at[1], 0.5);  // only one other view there is
}

TEST_F(RetrievalEvaluationTest, NamesWhatCannotBeUsedAndCountsItAsMissed) {
  WriteText(folder_ / "set/o1/broken.png", "\x89PNG\r\n\x1a\n and no more");
  WriteBytes(folder_ / "set/o2/plain.png", EncodePng({64, 64, 1, std::vector<std::uint8_t>(4096)}));
  WriteText(folder_ / "set/o6/ref.png", "no image");  // o6 is then missed
  options_.protocols = {RetrievalProtocol::kUnverified};
  const RetrievalReport report = EvaluateRetrieval(Set(), options_);
  EXPECT_EQ(report.queries, 1U * kObjects);
  EXPECT_EQ(report.images, 2U * kObjects + 2);
  EXPECT_EQ(report.results[0].refused, 1U);
  EXPECT_DOUBLE_EQ(report.results[0].mean.top1, (kObjects - 1.0) / kObjects);
  EXPECT_LT(report.results[0].mean.map, (kObjects - 1.0) / kObjects);  // o1, o2 have three each
  ASSERT_THAT(report.skipped, SizeIs(3));
  EXPECT_THAT(report.skipped[0].file, HasSubstr("o1/broken.png"));
  EXPECT_EQ(report.skipped[1].code, "too_few_features");
  EXPECT_EQ(report.skipped[2].code, "image_type_unknown");
}

TEST_F(RetrievalEvaluationTest, AbsentObjectsAreFalseAlarmsWhenTheyAreFound) {
  for (std::uint64_t i = 1; i <= 5; ++i)
    WriteBytes(folder_ / ("absent/" + std::to_string(i) + ".png"), RandomPng(300 + i));
  WriteText(folder_ / "absent/broken.png", "no image");
  // Not absent at all: another image of an object that is searched.
  WriteBytes(folder_ / "alarming/1.png", OtherViewPng(3));
  options_.protocols = {RetrievalProtocol::kDefault, RetrievalProtocol::kUnverified};
  options_.words = {0};
  options_.seeds = 1;
  const auto evaluate = [&](const std::vector<std::filesystem::path>& absent) {
    return EvaluateRetrieval(ReadRetrievalSet(folder_ / "set", RetrievalLayout::kAuto, {}, absent),
                             options_);
  };
  const RetrievalReport none = evaluate({});
  const RetrievalReport quiet = evaluate({folder_ / "absent"});
  EXPECT_EQ(quiet.absent, 6U);
  EXPECT_EQ(quiet.queries, none.queries);
  EXPECT_EQ(quiet.distractors, 0U);
  ASSERT_THAT(quiet.results, SizeIs(2));
  ExpectEqual(quiet.results[0].mean, none.results[0].mean);
  EXPECT_EQ(quiet.results[0].refused, 0U);
  EXPECT_EQ(quiet.results[0].absent.asked, 5U);
  EXPECT_EQ(quiet.results[0].absent.alarms, 0U);
  EXPECT_DOUBLE_EQ(quiet.results[0].mean.found_right, 1);
  EXPECT_DOUBLE_EQ(quiet.results[0].mean.found_wrong, 0);
  EXPECT_DOUBLE_EQ(quiet.results[1].mean.found_right, 0) << "without verification nothing is";

  const RetrievalReport loud = evaluate({folder_ / "absent", folder_ / "alarming"});
  EXPECT_EQ(loud.results[0].absent.asked, 6U);
  EXPECT_EQ(loud.results[0].absent.alarms, 1U);
}

TEST_F(RetrievalEvaluationTest, QueriesAreAskedAgainWithoutTheirObject) {
  // Another object that shows the same as o1.
  WriteBytes(folder_ / "set/twin/ref.png", OtherViewPng(200));
  WriteBytes(folder_ / "set/twin/1.png", RandomPng(1));
  options_.protocols = {RetrievalProtocol::kDefault, RetrievalProtocol::kUnverified};
  options_.words = {0};
  options_.seeds = 1;
  const RetrievalReport report = EvaluateRetrieval(Set(), options_);
  EXPECT_EQ(report.results[0].left_out.asked, kObjects + 1U);
  EXPECT_EQ(report.results[0].left_out.alarms, 1U);
  EXPECT_EQ(report.results[1].left_out.asked, 0U) << "without probabilities nothing is found";
}

TEST_F(RetrievalEvaluationTest, TheCacheChangesNothing) {
  TemporaryFolder more;
  for (std::uint64_t i = 1; i <= 4; ++i)
    WriteBytes(more / (std::to_string(i) + ".png"), RandomPng(200 + i));
  const RetrievalReport plain = EvaluateRetrieval(Set(), options_);
  const RetrievalReport plain_more = EvaluateRetrieval(Set({more.path()}), options_);
  EXPECT_EQ(plain_more.distractors, 4U);
  EXPECT_EQ(plain_more.images, 2U * kObjects + 4);
  options_.cache = folder_ / "cache";
  for (int run = 0; run < 2; ++run) {  // the second describes nothing
    const RetrievalReport with_more = EvaluateRetrieval(Set({more.path()}), options_);
    const RetrievalReport cached = EvaluateRetrieval(Set(), options_);
    for (std::size_t i = 0; i < plain.results.size(); ++i) {
      ExpectEqual(cached.results[i].mean, plain.results[i].mean);
      ExpectEqual(cached.results[i].spread, plain.results[i].spread);
      ExpectEqual(with_more.results[i].mean, plain_more.results[i].mean);
    }
  }
  // One as the paper describes images, one as the product does.
  EXPECT_EQ(
      std::ranges::count_if(std::filesystem::directory_iterator(options_.cache),
                            [](const auto& file) { return file.path().extension() == ".db"; }),
      2);
}

TEST_F(RetrievalEvaluationTest, RowsForEachDescriptorAndSize) {
  options_.descriptors = {"sift", "orb"};
  options_.protocols = {RetrievalProtocol::kUnverified};
  options_.words = {5, 30};
  options_.seeds = 1;
  std::vector<std::string> told;
  options_.progress = [&](const std::string& what, std::size_t, std::size_t) {
    if (told.empty() || told.back() != what) told.push_back(what);
  };
  options_.jobs = 1;
  const RetrievalReport report = EvaluateRetrieval(Set(), options_);
  ASSERT_THAT(report.results, SizeIs(4));
  EXPECT_EQ(report.results[0].descriptor, "sift");
  EXPECT_EQ(report.results[1].words, 30U);
  EXPECT_EQ(report.results[2].descriptor, "orb");
  EXPECT_EQ(report.results[0].spread.map, 0);  // of one seed
  EXPECT_THAT(told, ::testing::Contains(HasSubstr("describing with orb")));
}

TEST_F(RetrievalEvaluationTest, BadOptionsAndStops) {
  const RetrievalOptions good = options_;
  const auto refuse = [&](const std::string& reason) {
    ExpectError(ErrorCode::kInvalidArgument, reason, [&] { EvaluateRetrieval(Set(), options_); });
    options_ = good;
  };
  options_.descriptors = {};
  refuse("descriptors_invalid");
  options_.protocols = {};
  refuse("protocols_invalid");
  options_.seeds = 0;
  refuse("seeds_invalid");
  options_.words = {-1};
  refuse("words_invalid");
  options_.descriptors = {"rootsift", "nonsense"};
  refuse("");
  std::stop_source stop;
  stop.request_stop();
  options_.stop = stop.get_token();
  ExpectError(ErrorCode::kCancelled, "evaluation_cancelled",
              [&] { EvaluateRetrieval(Set(), options_); });
}

TEST_F(RetrievalEvaluationTest, FeaturesOfAnotherModelAreNeverSearched) {
  EngineOptions engine_options;
  engine_options.database = folder_ / "x.db";
  engine_options.descriptor = "rootsift";
  Engine engine(engine_options);
  const auto bytes = RandomPng(1);
  AddRequest request;
  request.bytes = bytes;
  engine.Add(request);
  TrainOptions train;
  train.words = 5;
  engine.TrainVocabulary(train);
  ExtractionOptions of_queries;
  of_queries.enlarge_below = 1 << 20;
  const FeatureExtractor own(MakeDescriptor("rootsift"), of_queries);
  const SearchResult given = engine.SearchFeatures(own.Extract(bytes, 1), {});
  const SearchResult asked = engine.Search(bytes, {});
  ASSERT_THAT(given.hits, SizeIs(1));
  EXPECT_EQ(given.hits[0].score, asked.hits[0].score);
  EXPECT_EQ(given.hits[0].inliers, asked.hits[0].inliers);
  const FeatureExtractor other(MakeDescriptor("sift"), {});
  ExpectError(ErrorCode::kConflict, "model_mismatch",
              [&] { engine.SearchFeatures(other.Extract(bytes, 1), {}); });
}

}  // namespace
}  // namespace pliant
