// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How deep a search looks that is left to decide: further where nothing agrees.
#include <cstddef>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/unit/engine_fixture.h"

namespace pliant {
namespace {

using testing::EngineTest;
using testing::RandomImage;

constexpr int kDecoys = 130;  // more than are verified at first

class EngineDepthTest : public EngineTest {
 protected:
  // A query that shows eighteen points of one image, and four of each of the others, anywhere:
  // more of a small image than eighteen are of a large one, but they agree on no place.
  void SetUp() override {
    EngineOptions options = Options();
    options.max_keypoints = 1024;
    engine_.emplace(options);
    Add(*engine_, EncodePng(RandomImage(999, 400, 300)), "truth", "truth");
    for (int i = 0; i < kDecoys; ++i) {
      const std::string name = "decoy-" + std::to_string(i);
      Add(*engine_, EncodePng(RandomImage(static_cast<std::uint64_t>(i + 1), 60, 60)), name, name);
    }
    Train(*engine_, 50);
    Take("truth", 18, false);
    for (int i = 0; i < kDecoys; ++i) Take("decoy-" + std::to_string(i), 4, true);
  }
  void Take(const std::string& id, std::size_t count, bool scattered) {
    const Features of = engine_->GetFeatures("default", id);
    ASSERT_GE(of.keypoints.size(), count);
    const std::size_t step = of.keypoints.size() / count;
    if (query_.keypoints.empty()) {
      query_ = {4000, 3000, {}, Descriptors::Float(0, of.descriptors.dim), of.model_id};
    }
    for (std::size_t i = 0; i < count * step; i += step) {
      query_.keypoints.push_back(of.keypoints[i]);
      Keypoint& keypoint = query_.keypoints.back();
      if (scattered) {
        keypoint.x = static_cast<float>(random_() % 4000);
        keypoint.y = static_cast<float>(random_() % 3000);
        keypoint.angle = static_cast<float>(random_() % 360);
      }
      const auto row = of.descriptors.float_row(i);
      Descriptors one = Descriptors::Float(1, of.descriptors.dim);
      one.floats.assign(row.begin(), row.end());
      query_.descriptors.Append(one);
    }
  }

  std::optional<Engine> engine_;
  Features query_;

 private:
  std::mt19937_64 random_{1};
};

TEST_F(EngineDepthTest, WhereNothingAgreesMoreIsLookedAt) {
  SearchOptions options;
  options.verify = Verification::kNone;
  options.limit = 0;
  const SearchResult ranked = engine_->SearchFeatures(query_, options);
  ASSERT_GT(ranked.hits.size(), 100U);
  for (std::size_t i = 0; i < 100; ++i) {
    ASSERT_NE(ranked.hits[i].object, "truth") << "it must be ranked below what is looked at first";
  }
  options.verify = Verification::kTps;
  options.verify_depth = 100;
  for (const Hit& hit : engine_->SearchFeatures(query_, options).hits) EXPECT_EQ(hit.inliers, 0);
  options.verify_depth = 0;
  const SearchResult deeper = engine_->SearchFeatures(query_, options);
  ASSERT_EQ(deeper.hits.size(), ranked.hits.size()) << "each once";
  EXPECT_EQ(deeper.hits[0].object, "truth");
  EXPECT_GE(deeper.hits[0].inliers, 6);
  // Pages fit together.
  options.offset = 1;
  options.limit = 5;
  const SearchResult page = engine_->SearchFeatures(query_, options);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(page.hits[i].image_id, deeper.hits[i + 1].image_id);
}

}  // namespace
}  // namespace pliant
