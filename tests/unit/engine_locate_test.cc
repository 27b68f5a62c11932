// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Where an object of the database is in an image.
#include <cmath>

#include <gtest/gtest.h>

#include "index/engine/engine.h"
#include "index/verify/locate.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_images.h"
#include "tests/unit/test_database.h"

namespace pliant {
namespace {

using testing::ExpectError;
using testing::OtherViewPng;
using testing::RandomPng;

class EngineLocateTest : public ::testing::Test {
 protected:
  EngineLocateTest() : engine_(Options()) {}

  EngineOptions Options() {
    EngineOptions options;
    options.database = testing::Database(folder_ / "a.db");
    options.descriptor = "rootsift";
    return options;
  }
  void Add(std::uint64_t image, const std::string& object) {
    const std::vector<std::uint8_t> png = RandomPng(image);
    AddRequest request;
    request.bytes = png;
    request.object = object;
    request.id = "p" + std::to_string(image);
    engine_.Add(request);
  }
  ObjectLocation Locate(std::uint64_t view, const std::string& object) {
    return engine_.Locate(OtherViewPng(view), kDefaultCollection, object, 1);
  }

  testing::TemporaryFolder folder_;
  Engine engine_;
};

TEST_F(EngineLocateTest, FindsTheObjectWithoutAVocabulary) {
  for (std::uint64_t i = 1; i <= 4; ++i) Add(i, i <= 3 ? "cup" : "hat");
  const ObjectLocation found = Locate(2, "cup");
  EXPECT_EQ(found.object, "cup");
  EXPECT_EQ(found.image_id, "p2");
  EXPECT_EQ(found.compared, 3U);
  EXPECT_EQ(found.query_width, 160);
  ASSERT_TRUE(found.location.found) << ToString(found.location.reason);
  EXPECT_GE(found.location.inliers.size(), 15U);
  EXPECT_GE(found.location.outline.size(), 3U);
  // The view is shifted by (5, 3).
  const Mesh& mesh = *found.location.mesh;
  const int c = mesh.columns / 2;
  const int r = mesh.rows / 2;
  const Vec2 from = mesh.reference_point(c, r);
  const Vec2 to = mesh.points[static_cast<std::size_t>(r * mesh.columns + c)];
  EXPECT_NEAR(to.x - from.x, 5, 1);
  EXPECT_NEAR(to.y - from.y, 3, 1);

  const ObjectLocation lost = Locate(2, "hat");
  EXPECT_FALSE(lost.location.found);
  EXPECT_EQ(lost.image_id, "p4");
  EXPECT_NE(lost.location.reason, LostReason::kNone);
}

TEST_F(EngineLocateTest, OfManyImagesTheMostSimilar) {
  for (std::uint64_t i = 1; i <= 30; ++i) Add(i, "crowd");
  TrainOptions train;
  train.words = 50;
  engine_.TrainVocabulary(train);
  int right = 0;
  for (const std::uint64_t i : {3, 17, 29, 30}) {
    const ObjectLocation found = Locate(i, "crowd");
    EXPECT_EQ(found.compared, 24U);
    right += found.location.found && found.image_id == "p" + std::to_string(i) ? 1 : 0;
  }
  EXPECT_EQ(right, 4);
}

TEST_F(EngineLocateTest, SaysWhatIsMissing) {
  Add(1, "cup");
  ExpectError(ErrorCode::kNotFound, "object_not_found", [&] { Locate(1, "hat"); });
  ExpectError(ErrorCode::kNotFound, "collection_not_found",
              [&] { engine_.Locate(OtherViewPng(1), "nowhere", "cup", 1); });
  const std::vector<std::uint8_t> flat = EncodePng({64, 64, 1, std::vector<std::uint8_t>(4096, 9)});
  const ObjectLocation nothing = engine_.Locate(flat, kDefaultCollection, "cup", 1);
  EXPECT_FALSE(nothing.location.found);
  EXPECT_EQ(nothing.location.reason, LostReason::kFewKeypoints);
  const std::vector<std::uint8_t> text = {'n', 'o'};
  EXPECT_THROW(engine_.Locate(text, kDefaultCollection, "cup", 1), Error);
}

}  // namespace
}  // namespace pliant
