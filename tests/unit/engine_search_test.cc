// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Searching.
#include "index/json/result_json.h"
#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST_F(EngineTest, AnOtherViewFindsItsObject) {
  Engine engine(Options());
  for (std::uint64_t i = 1; i <= 12; ++i) Add(engine, RandomPng(i), "o" + std::to_string(i));
  ExpectError(ErrorCode::kConflict, "no_vocabulary", [&] { engine.Search(RandomPng(1), {}); });
  const VocabularyRecord vocabulary = Train(engine, 200);
  EXPECT_TRUE(vocabulary.active) << "the first one is used at once";
  for (const RankMethod method : {RankMethod::kNeighbours, RankMethod::kHistogram}) {
    for (std::uint64_t i = 1; i <= 12; ++i) {
      SearchOptions options;
      options.rank = method;
      const SearchResult result = engine.Search(OtherViewPng(i), options);
      ASSERT_FALSE(result.hits.empty());
      EXPECT_EQ(result.hits[0].object, "o" + std::to_string(i));
      EXPECT_EQ(result.hits[0].rank, 1u);
      EXPECT_EQ(result.rank, method);
      EXPECT_EQ(result.vocabulary, vocabulary.id);
      EXPECT_EQ(result.words, 200u);
    }
  }
}

TEST_F(EngineTest, OfTwoObjectsThatLookTheSameNeitherIsFound) {
  Engine engine(Options());
  const Image same = RandomImage(1, 320, 240);
  Add(engine, NoisyPng(same, 1), "one");
  Add(engine, NoisyPng(same, 2), "another");
  for (std::uint64_t i = 2; i <= 8; ++i) Add(engine, RandomPng(i), "o" + std::to_string(i));
  Train(engine, 200);
  const auto expect_perhaps = [](const SearchResult& result) {
    ASSERT_GE(result.hits.size(), 2U);
    EXPECT_EQ(result.found, 0U);
    EXPECT_TRUE(result.perhaps);
    EXPECT_THAT((std::vector{result.hits[0].object, result.hits[1].object}),
                ::testing::UnorderedElementsAre("one", "another"));
    EXPECT_GT(*result.hits[0].probability + *result.hits[1].probability, kFoundProbability);
    EXPECT_EQ(SearchResultJson(result, 1)["verdict"], "perhaps");
  };
  expect_perhaps(engine.Search(NoisyPng(same, 3), {}));
  Add(engine, NoisyPng(same, 4), "", "photo");
  expect_perhaps(engine.SearchExamples({"photo"}, {}));

  const SearchResult found = engine.Search(OtherViewPng(5), {});
  EXPECT_EQ(found.found, 1U);
  EXPECT_FALSE(found.perhaps);
  EXPECT_EQ(SearchResultJson(found, 1)["verdict"], "found");
  const SearchResult absent = engine.Search(RandomPng(99), {});
  EXPECT_EQ(absent.found, 0U);
  EXPECT_FALSE(absent.perhaps);
  EXPECT_EQ(SearchResultJson(absent, 1)["verdict"], "not_found");
}

TEST_F(EngineTest, NoHitStandsBelowALessProbableOne) {
  Engine engine(Options());
  for (std::uint64_t i = 1; i <= 40; ++i) {
    Add(engine, i % 4 == 0 ? NoisyPng(RandomImage(i / 8, 320, 240), i) : RandomPng(i),
        "o" + std::to_string(i % 30));
  }
  Train(engine, 200);
  for (std::uint64_t i = 1; i <= 60; ++i) {
    SearchOptions options;
    options.limit = 0;
    options.group_by = i % 2 == 0 ? GroupBy::kImage : GroupBy::kObject;
    const auto photo = i % 3 == 0 ? NoisyPng(RandomImage(i / 9, 320, 240), 99) : OtherViewPng(i);
    const SearchResult result = engine.Search(photo, options);
    for (std::size_t k = 1; k < result.hits.size(); ++k) {
      const Hit& better = result.hits[k - 1];
      const Hit& worse = result.hits[k];
      ASSERT_GE(*better.probability, *worse.probability) << i << ", hit " << k;
      if (*better.probability == *worse.probability && worse.inliers > 0) {
        EXPECT_GE(better.score, worse.score) << i << ", hit " << k;
      }
    }
  }
}

// A board is a part of any larger one, and both have corners only.
TEST_F(EngineTest, ABoardWithMoreFieldsIsNotFound) {
  const auto board = [](int fields) {
    Image image{600, 600, 1, std::vector<std::uint8_t>(360'000)};
    for (int y = 0; y < 600; ++y) {
      for (int x = 0; x < 600; ++x) {
        image.pixels[static_cast<std::size_t>(600 * y + x)] =
            (x * fields / 600 + y * fields / 600) % 2 == 0 ? 10 : 245;
      }
    }
    return EncodePng(image);
  };
  Engine engine(Options());
  Add(engine, board(8), "board");
  for (std::uint64_t i = 1; i <= 8; ++i) Add(engine, RandomPng(i), "o" + std::to_string(i));
  Train(engine, 200);
  for (const int fields : {10, 13}) {
    EXPECT_EQ(engine.Search(board(fields), {}).found, 0U) << fields;
  }
}

TEST_F(EngineTest, ASecondPassIsMadeWhereNothingIsFound) {
  Engine engine(Options());
  AddMany(engine, 8);
  Train(engine);
  const FeatureExtractor extractor(MakeDescriptor("rootsift"), {});
  const Features absent = extractor.Extract(RandomPng(99), 1);
  const Features present = extractor.Extract(OtherViewPng(3), 1);
  int looks = 0;
  const auto look = [&](const Features& seen) {
    return [&looks, &seen](ExtractionTimings* timings) -> std::optional<Features> {
      ++looks;
      timings->detect_ms += 1000;
      return seen;
    };
  };
  const SearchResult found = engine.SearchFeatures(absent, {}, look(present));
  EXPECT_EQ(found.found, 1U);
  EXPECT_EQ(found.hits.at(0).object, "o2");
  EXPECT_TRUE(found.second_pass);
  EXPECT_EQ(found.keypoints, present.keypoints.size());
  EXPECT_GE(found.timings.extraction.detect_ms, 1000) << "both looks take their time";
  EXPECT_EQ(looks, 1);

  // No better: the first answer stays, and says that it was tried.
  const SearchResult still_absent = engine.SearchFeatures(absent, {}, look(absent));
  EXPECT_EQ(still_absent.found, 0U);
  EXPECT_TRUE(still_absent.second_pass);
  EXPECT_GE(still_absent.timings.extraction.detect_ms, 1000);
  EXPECT_EQ(looks, 2);
  const SearchResult no_more = engine.SearchFeatures(
      absent, {}, [](ExtractionTimings*) { return std::optional<Features>(); });
  EXPECT_FALSE(no_more.second_pass);
  EXPECT_EQ(Ids(no_more), Ids(still_absent));

  EXPECT_FALSE(engine.SearchFeatures(present, {}, look(absent)).second_pass) << "found at once";
  SearchOptions without;
  without.second_pass = false;
  EXPECT_EQ(engine.SearchFeatures(absent, without, look(present)).found, 0U);
  SearchOptions unverified;  // which has no probabilities
  unverified.verify = Verification::kNone;
  EXPECT_FALSE(engine.SearchFeatures(absent, unverified, look(present)).second_pass);
  EXPECT_EQ(looks, 2);

  // Whichever page is asked for, the same look decides.
  SearchOptions second;
  second.limit = 1;
  second.offset = 1;
  const auto page = engine.SearchFeatures(absent, second, look(present));
  EXPECT_TRUE(page.second_pass);
  EXPECT_EQ(Ids(page).at(0), Ids(found).at(1));
}

TEST_F(EngineTest, SearchMakesItsSecondPassOfTheImageItself) {
  Engine engine(Options());
  AddMany(engine, 6);
  Train(engine);
  EXPECT_TRUE(engine.Search(RandomPng(99), {}).second_pass);
  EXPECT_FALSE(engine.Search(OtherViewPng(3), {}).second_pass);
  EXPECT_FALSE(engine.SearchStored("p1", {}).second_pass);
  SearchOptions without;
  without.second_pass = false;
  EXPECT_FALSE(engine.Search(RandomPng(99), without).second_pass);
}

// Of an image with all its keypoints: otherwise a query has more than what is kept.
EngineOptions WithAllKeypoints(EngineOptions options) {
  options.max_keypoints = kMaxKeypoints;
  return options;
}

TEST_F(EngineTest, ItselfScoresOneAndComesByIdToo) {
  Engine engine(WithAllKeypoints(Options()));
  AddMany(engine, 6);
  Train(engine);
  for (const RankMethod method : {RankMethod::kNeighbours, RankMethod::kHistogram}) {
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
  Engine engine(WithAllKeypoints(Options()));
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
  EXPECT_EQ(objects.hits.size(), 6u) << "four objects and two images without one";
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
  strict.min_score = engine.Search(RandomPng(3), strict).hits[0].score - 1e-9;
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

TEST_F(EngineTest, AQueryHasTwiceTheKeypointsThatAreKept) {
  EngineOptions options = Options();
  options.max_keypoints = 30;
  options.enlarge = false;
  Engine engine(options);
  AddMany(engine, 4);
  Train(engine);
  EXPECT_EQ(engine.GetFeatures("default", "p3").keypoints.size(), 30U);
  EXPECT_EQ(engine.Search(RandomPng(3), ByImage()).keypoints, 60U);
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

}  // namespace
}  // namespace pliant::testing
