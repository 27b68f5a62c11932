// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How deep a search looks in a large collection: no further than twice as far as the last image
// that agrees.
#include <algorithm>
#include <deque>
#include <random>
#include <string>
#include <vector>

#include "index/store/blob_codec.h"
#include "index/store/open_store.h"
#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

constexpr std::size_t kImages = 220;

class EngineEnoughTest : public EngineTest {
 protected:
  // The query's image, and many that have five of its descriptors anywhere.
  void SetUp() override {
    Add(engine_, EncodePng(RandomImage(999, 400, 300)), "truth", "truth");
    Train(engine_, 50);
    query_ = engine_.GetFeatures("default", "truth");
    std::vector<Features> decoys;
    for (std::size_t i = 0; i < kImages; ++i) decoys.push_back(Scattered(5));
    Put("decoy", decoys);
  }

  Features Scattered(std::size_t count) {
    Features some{400, 300, {}, Descriptors::Float(0, query_.descriptors.dim), query_.model_id};
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t row = random_() % query_.keypoints.size();
      Keypoint keypoint = query_.keypoints[row];
      keypoint.x = static_cast<float>(random_() % 400);
      keypoint.y = static_cast<float>(random_() % 300);
      some.keypoints.push_back(keypoint);
      const auto values = query_.descriptors.float_row(row);
      Descriptors one = Descriptors::Float(1, query_.descriptors.dim);
      one.floats.assign(values.begin(), values.end());
      some.descriptors.Append(one);
    }
    return some;
  }

  void Put(const std::string& name, const std::vector<Features>& images) {
    const auto store =
        OpenStore({.database = Options().database, .create = false, .model_of_new = {}});
    store->OpenOriginals(std::nullopt, false);
    store->BeginWriting([] {});
    const CollectionState in = store->catalogue().RequireCollection("default");
    const Quantizer quantizer(store->catalogue().ReadVocabulary(in.vocabulary));
    std::deque<AddRequest> requests;
    std::vector<ImagePut> puts;
    for (const Features& image : images) {
      AddRequest& request = requests.emplace_back();
      request.id = name + "-" + std::to_string(requests.size());
      ImagePut& put = puts.emplace_back(ImagePut{.request = request});
      put.record.id = *request.id;
      put.record.sha256 = std::string(64, 'a');
      put.record.media_type = "image/png";
      put.record.width = image.width;
      put.record.height = image.height;
      put.record.keypoints = static_cast<std::uint32_t>(image.keypoints.size());
      put.encoded = EncodeFeatures(image);
      put.features = DecodeFeatures(put.encoded);
      put.vocabulary = in.vocabulary;
      put.words = quantizer.Assign(put.features.descriptors, 1);
      put.keep_content = false;
    }
    store->writer().PutAll(puts);
  }

  static bool IsLookedAt(const Hit& hit) {
    return hit.explanation.value().failure.find("was not verified") == std::string::npos;
  }
  // How many images the search has verified.
  std::size_t LookedAt(std::size_t depth) {
    SearchOptions options = ByImage(200);
    options.explain = true;
    options.verify_depth = depth;
    const SearchResult result = engine_.SearchFeatures(query_, options);
    EXPECT_EQ(result.total, engine_.GetCollection("default").images);
    EXPECT_EQ(result.hits.size(), 200U);
    EXPECT_GT(result.hits[0].inliers, 0);
    return static_cast<std::size_t>(
        std::count_if(result.hits.begin(), result.hits.end(), IsLookedAt));
  }

  Engine engine_{Options()};
  Features query_;

 private:
  std::mt19937_64 random_{1};
};

TEST_F(EngineEnoughTest, WhatLiesFarBehindTheLastThatAgreesIsNotLookedAt) {
  EXPECT_EQ(LookedAt(0), 30U);
  EXPECT_EQ(LookedAt(110), 110U) << "as many as are asked for";
  Put("view", std::vector<Features>(20, query_));
  EXPECT_EQ(LookedAt(0), 60U) << "the last that agrees is beyond the middle of 30";
  Put("further", std::vector<Features>(40, query_));
  EXPECT_EQ(LookedAt(0), 100U) << "the most";
}

}  // namespace
}  // namespace pliant::testing
