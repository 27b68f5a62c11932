// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/blob_codec.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <span>

#include <gtest/gtest.h>

#include "tests/unit/expect_error.h"

namespace pliant {
namespace {

using testing::ExpectError;

enum class Values { kUnit, kWhole, kBits };

Features RandomFeatures(std::size_t rows, Values values, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
  Features features;
  features.width = 640;
  features.height = 480;
  for (std::size_t i = 0; i < rows; ++i) {
    features.keypoints.push_back({(uniform(random) + 1) * 319, (uniform(random) + 1) * 239, 3.5F,
                                  uniform(random) * 180 + 180, std::abs(uniform(random)) + 1e-5F});
  }
  Descriptors& d = features.descriptors;
  if (values == Values::kBits) {
    d = Descriptors::Binary(rows, 32);
    for (auto& byte : d.bytes) byte = static_cast<std::uint8_t>(random());
    return features;
  }
  d = Descriptors::Float(rows, 128);
  for (auto& v : d.floats) {
    v = values == Values::kWhole ? static_cast<float>(random() % 256) : uniform(random);
  }
  return features;
}

// Of the rows' squared length: what is not in `back`.
double ShareLost(const Descriptors& rows, const Descriptors& back) {
  double lost = 0;
  double length = 0;
  for (std::size_t i = 0; i < rows.floats.size(); ++i) {
    lost += std::pow(rows.floats[i] - back.floats[i], 2);
    length += std::pow(rows.floats[i], 2);
  }
  return length > 0 ? lost / length : 0;
}

class EveryKind : public ::testing::TestWithParam<Values> {};
INSTANTIATE_TEST_SUITE_P(BlobCodec, EveryKind,
                         ::testing::Values(Values::kUnit, Values::kWhole, Values::kBits));

TEST_P(EveryKind, StoredPrecisionIsThatOfABlobAndStaysAsItIs) {
  Features features = RandomFeatures(41, GetParam(), 5);
  features.model_id = "m";
  const Features rounded = InStoredPrecision(features);
  const Features back = DecodeFeatures(EncodeFeatures(features));
  EXPECT_EQ(rounded.model_id, "m");
  EXPECT_EQ(rounded.keypoints, back.keypoints);
  EXPECT_EQ(rounded.descriptors.bytes, back.descriptors.bytes);
  EXPECT_EQ(rounded.descriptors.floats, back.descriptors.floats);
  const Features again = InStoredPrecision(rounded);
  EXPECT_EQ(again.keypoints, rounded.keypoints);
  EXPECT_EQ(again.descriptors.bytes, rounded.descriptors.bytes);
  for (std::size_t i = 0; i < rounded.descriptors.floats.size(); ++i) {
    ASSERT_NEAR(again.descriptors.floats[i], rounded.descriptors.floats[i],
                1e-5 * std::abs(rounded.descriptors.floats[i]) + 1e-4)
        << i;
  }
}

TEST_P(EveryKind, ComesBackNearly) {
  for (const std::size_t rows : {std::size_t{0}, std::size_t{1}, std::size_t{37}}) {
    const Features features = RandomFeatures(rows, GetParam(), rows + 1);
    const Features back = DecodeFeatures(EncodeFeatures(features));
    EXPECT_EQ(back.width, 640);
    EXPECT_EQ(back.height, 480);
    ASSERT_EQ(back.keypoints.size(), rows);
    for (std::size_t i = 0; i < rows; ++i) {
      const Keypoint& was = features.keypoints[i];
      const Keypoint& is = back.keypoints[i];
      EXPECT_NEAR(is.x, was.x, 0.51 * 640 / 65535);
      EXPECT_NEAR(is.y, was.y, 0.51 * 480 / 65535);
      EXPECT_NEAR(std::log2(is.size / was.size), 0, 0.51 / 4096);
      EXPECT_NEAR(std::remainder(is.angle - was.angle, 360), 0, 0.51 * 360 / 256);
      EXPECT_NEAR(std::log2(is.response / was.response), 0, 0.51 / 8);
    }
    EXPECT_EQ(back.descriptors.kind, features.descriptors.kind);
    EXPECT_EQ(back.descriptors.dim, features.descriptors.dim);
    EXPECT_EQ(back.descriptors.rows, rows);
    EXPECT_EQ(back.descriptors.bytes, features.descriptors.bytes);
    EXPECT_LT(ShareLost(features.descriptors, back.descriptors), 0.025);
  }
}

TEST(BlobCodec, AKeypointTakesEightBytesAndAComponentFourBits) {
  for (const auto& [dim, row] : {std::pair{64, 34}, {128, 66}, {96, 66}, {1, 3}}) {
    Features one = RandomFeatures(1, Values::kUnit, 2);
    Features two = RandomFeatures(2, Values::kUnit, 2);
    one.descriptors = Descriptors::Float(1, dim);
    two.descriptors = Descriptors::Float(2, dim);
    EXPECT_EQ(EncodeFeatures(two).size() - EncodeFeatures(one).size(),
              static_cast<std::size_t>(8 + row));
  }
}

// Few components that hold all of the length, and rows far from 0 on average.
TEST(BlobCodec, UnevenRowsLoseNoMore) {
  std::mt19937_64 random(3);
  for (const int dim : {64, 128, 200}) {
    Features features = RandomFeatures(30, Values::kUnit, 5);
    features.descriptors = Descriptors::Float(30, dim);
    for (std::size_t i = 0; i < 30; ++i) {
      float* row = features.descriptors.floats.data() + i * static_cast<std::size_t>(dim);
      for (int d = 0; d < dim; ++d) {
        row[d] = i % 2 == 0 ? 3 : (random() % 16 == 0 ? 50.0F : 0.1F);
      }
    }
    const Features back = DecodeFeatures(EncodeFeatures(features));
    EXPECT_LT(ShareLost(features.descriptors, back.descriptors), 0.025) << dim;
  }
}

TEST(BlobCodec, KeypointsOutsideMoveToTheEdgeAndUnknownValuesStayUnknown) {
  Features features = RandomFeatures(2, Values::kBits, 7);
  features.keypoints = {{-30, 500, 0, -90, 0}, {1e9F, -1e9F, 1e9F, 725, 1e9F}};
  const Features back = DecodeFeatures(EncodeFeatures(features));
  EXPECT_EQ(back.keypoints[0], (Keypoint{-0.5F, 479.5F, 0, 270, 0}));
  EXPECT_EQ(back.keypoints[1].x, 639.5F);
  EXPECT_EQ(back.keypoints[1].y, -0.5F);
  EXPECT_NEAR(back.keypoints[1].size, 16384, 10);
  EXPECT_NEAR(back.keypoints[1].angle, 5, 0.8);
  EXPECT_GT(back.keypoints[1].response, 3000);
}

TEST_P(EveryKind, AnyDamageIsNoticed) {
  const std::vector<std::uint8_t> blob = EncodeFeatures(RandomFeatures(3, GetParam(), 9));
  for (std::size_t i = 0; i < blob.size(); ++i) {
    std::vector<std::uint8_t> damaged = blob;
    damaged[i] ^= static_cast<std::uint8_t>(1u << (i % 8));
    ExpectError(ErrorCode::kCorrupt, "blob_corrupt", [&] { DecodeFeatures(damaged); });
  }
  for (std::size_t size = 0; size < blob.size(); ++size) {
    ExpectError(ErrorCode::kCorrupt, "blob_corrupt",
                [&] { DecodeFeatures(Bytes(blob).first(size)); });
  }
}

TEST(BlobCodec, ColoursComeBack) {
  Features features = RandomFeatures(3, Values::kUnit, 8);
  const std::vector<std::uint8_t> without = EncodeFeatures(features);
  EXPECT_TRUE(DecodeFeatures(without).colours.empty()) << "as of a grey image";
  features.colours = {3, 2, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 255}};
  const std::vector<std::uint8_t> blob = EncodeFeatures(features);
  const Features back = DecodeFeatures(blob);
  EXPECT_EQ(back.colours, features.colours);
  EXPECT_EQ(InStoredPrecision(features).colours, features.colours);
}

TEST(BlobCodec, PreviewsComeBack) {
  Features features = RandomFeatures(3, Values::kUnit, 8);
  EXPECT_TRUE(DecodeFeatures(EncodeFeatures(features)).preview.empty());
  features.preview = {1, 2, 3, 4, 5, 255};
  for (const ColourGrid& colours : {ColourGrid{}, ColourGrid{2, 1, {1, 2, 3, 4}}}) {
    features.colours = colours;
    for (const Features& back :
         {DecodeFeatures(EncodeFeatures(features)), InStoredPrecision(features)}) {
      EXPECT_EQ(back.preview, features.preview);
      EXPECT_EQ(back.colours, colours);
    }
  }
}

TEST(BlobCodec, PreviewsOfAnotherSizeAreRefused) {
  Features features = RandomFeatures(3, Values::kUnit, 8);
  features.preview = std::vector<std::uint8_t>(6);
  const std::vector<std::uint8_t> blob = EncodeFeatures(features);
  const std::size_t preview = blob.size() - 4 - 6 - 4;
  for (const auto& [at, value] : {std::pair<std::size_t, int>{preview, 7},
                                  {preview, 5},
                                  {preview, 0},
                                  {preview + 3, 255},
                                  {6, 0},
                                  {6, 1}}) {
    std::vector<std::uint8_t> changed(blob.begin(), blob.end() - 4);
    changed[at] = static_cast<std::uint8_t>(value);
    PutValue(changed, Crc32(changed));
    ExpectError(ErrorCode::kCorrupt, "blob_corrupt", [&] { DecodeFeatures(changed); });
  }
}

TEST(BlobCodec, ColoursAreCompressed) {
  Features features = RandomFeatures(3, Values::kUnit, 8);
  const std::size_t without = EncodeFeatures(features).size();
  features.colours = {64, 64, {}};
  for (int i = 0; i < 64 * 64; ++i) {  // a* changes from row to row, b* does not
    features.colours.chroma.push_back(static_cast<std::uint8_t>(100 + i / 64));
    features.colours.chroma.push_back(128);
  }
  EXPECT_LT(EncodeFeatures(features).size(), without + 500);
  EXPECT_EQ(InStoredPrecision(features).colours, features.colours);
}

TEST(BlobCodec, ColoursThatDoNotFitAreNotWritten) {
  Features features = RandomFeatures(3, Values::kUnit, 8);
  for (const ColourGrid& wrong :
       {ColourGrid{3, 2, std::vector<std::uint8_t>(11)}, ColourGrid{3, 2, {}},
        ColourGrid{-3, -2, std::vector<std::uint8_t>(12)},
        ColourGrid{0, 0, std::vector<std::uint8_t>(2)},
        ColourGrid{2000, 1, std::vector<std::uint8_t>(4000)}}) {
    features.colours = wrong;
    ExpectError(ErrorCode::kInvalidArgument, "features_shape", [&] { EncodeFeatures(features); });
  }
}

// With a valid checksum: as another program may write it.
TEST(BlobCodec, ColoursOfAnotherSizeAreRefused) {
  Features features = RandomFeatures(3, Values::kUnit, 8);
  features.colours = {3, 2, std::vector<std::uint8_t>(12, 128)};
  const std::vector<std::uint8_t> blob = EncodeFeatures(features);
  features.colours = {};
  const std::size_t colours = EncodeFeatures(features).size() - 4;
  const auto refused = [&](const auto& change) {
    std::vector<std::uint8_t> changed(blob.begin(), blob.end() - 4);
    change(&changed);
    PutValue(changed, Crc32(changed));
    ExpectError(ErrorCode::kCorrupt, "blob_corrupt", [&] { DecodeFeatures(changed); });
  };
  refused([&](auto* b) { (*b)[6] = 0; });        // there are none, it says
  refused([&](auto* b) { (*b)[6] = 4; });        // of an unknown kind
  refused([&](auto* b) { (*b)[6] = 3; });        // there is a preview, it says
  refused([&](auto* b) { (*b)[colours] = 4; });  // columns
  refused([&](auto* b) { (*b)[colours] = 0; });
  refused([&](auto* b) { (*b)[colours + 3] = 9; });  // rows beyond all bounds
  refused([&](auto* b) { b->pop_back(); });
  refused([&](auto* b) { b->push_back(0); });
  refused([&](auto* b) { b->resize(colours + 3); });
  refused([&](auto* b) { b->resize(colours); });
  refused([&](auto* b) { (*b)[colours + 6] ^= 0x40; });  // in what is compressed
}

TEST(BlobCodec, ValuesTooLargeAreRefusedAndLargeOnesComeBack) {
  Features features = RandomFeatures(1, Values::kUnit, 4);
  features.descriptors.floats[0] = 1e30F;
  EXPECT_NEAR(DecodeFeatures(EncodeFeatures(features)).descriptors.floats[0] / 1e30, 1, 0.1);
  features.descriptors.floats[0] = std::numeric_limits<float>::max();
  ExpectError(ErrorCode::kInvalidArgument, "descriptor_not_finite",
              [&] { EncodeFeatures(features); });
}

TEST(BlobCodec, RowsOfZerosAndKeptModelId) {
  Features features = RandomFeatures(2, Values::kUnit, 6);
  std::fill_n(features.descriptors.floats.begin(), 128, 0.0F);
  features.model_id = "deal:1";
  const Features back = InStoredPrecision(features);
  EXPECT_EQ(back.model_id, "deal:1");
  for (std::size_t d = 0; d < 128; ++d) EXPECT_EQ(back.descriptors.floats[d], 0.0F);
}

TEST(BlobCodec, BadFeaturesAreRefused) {
  Features features = RandomFeatures(2, Values::kUnit, 7);
  features.descriptors.floats[5] = std::nanf("");
  ExpectError(ErrorCode::kInvalidArgument, "descriptor_not_finite",
              [&] { EncodeFeatures(features); });
  features = RandomFeatures(2, Values::kUnit, 7);
  features.keypoints.pop_back();
  ExpectError(ErrorCode::kInvalidArgument, "features_shape", [&] { EncodeFeatures(features); });
  features = RandomFeatures(2, Values::kUnit, 7);
  features.width = 0;
  ExpectError(ErrorCode::kInvalidArgument, "features_shape", [&] { EncodeFeatures(features); });
  features = RandomFeatures(2, Values::kUnit, 7);
  features.keypoints[1].size = std::numeric_limits<float>::infinity();
  ExpectError(ErrorCode::kInvalidArgument, "keypoint_not_finite",
              [&] { EncodeFeatures(features); });
}

// A blob whose checksum is right but whose header lies must not make the reader allocate or run on.
TEST(BlobCodec, LyingHeadersWithAGoodChecksum) {
  const std::vector<std::uint8_t> blob = EncodeFeatures(RandomFeatures(3, Values::kUnit, 9));
  const auto with = [&](std::size_t at, std::uint32_t value, std::size_t bytes) {
    std::vector<std::uint8_t> changed(blob.begin(), blob.end() - 4);
    std::memcpy(changed.data() + at, &value, bytes);
    const std::uint32_t crc = Crc32(changed);
    const auto* raw = reinterpret_cast<const std::uint8_t*>(&crc);
    changed.insert(changed.end(), raw, raw + 4);
    return changed;
  };
  for (const auto& [at, value, bytes] :
       std::vector<std::tuple<std::size_t, std::uint32_t, std::size_t>>{
           {0, 'X', 1},
           {4, 1, 1},
           {5, 1, 1},
           {5, 7, 1},
           {6, 1, 1},
           {6, 9, 1},
           {7, 4, 4},
           {7, 0xffffffff, 4},
           {11, 64, 4},
           {11, 0xffffffff, 4},
           {15, 0, 4},           // no width
           {19, 0x80000000, 4},  // height
           {23 + 3 * 8, 0x7fc0, 2},
           {23 + 3 * 8, 0xbf80, 2}}) {  // scales: not a number, -1
    const std::vector<std::uint8_t> changed = with(at, value, bytes);
    ExpectError(ErrorCode::kCorrupt, "blob_corrupt", [&] { DecodeFeatures(changed); });
  }
}

TEST(BlobCodec, WordsComeBack) {
  std::mt19937_64 random(11);
  for (std::size_t round = 0; round < 200; ++round) {
    const std::uint32_t largest = round == 199 ? ~0U : (1U << round % 20U) - 1;
    std::vector<std::uint32_t> words(round);
    for (std::uint32_t& word : words) word = static_cast<std::uint32_t>(random()) & largest;
    if (round > 0) words[random() % round] = largest;
    const std::vector<std::uint8_t> blob = EncodeWords(words);
    ASSERT_EQ(DecodeWords(blob, std::size_t{largest} + 1), words) << "round " << round;
    EXPECT_LE(blob.size(), 8 + (round * (round == 199 ? 32 : round % 20) + 7) / 8);
    if (round > 0) {
      ExpectError(ErrorCode::kCorrupt, "blob_corrupt", [&] { DecodeWords(blob, largest); });
    }
  }
}

TEST(BlobCodec, DamagedWordsAreNoticed) {
  const std::vector<std::uint8_t> blob = EncodeWords(std::vector<std::uint32_t>{0, 300, 301, 7, 7});
  for (std::size_t i = 0; i < blob.size(); ++i) {
    std::vector<std::uint8_t> damaged = blob;
    damaged[i] ^= 0x10;
    ExpectError(ErrorCode::kCorrupt, "blob_corrupt", [&] { DecodeWords(damaged, 1000); });
    ExpectError(ErrorCode::kCorrupt, "blob_corrupt",
                [&] { DecodeWords(Bytes(blob).first(i), 1000); });
  }
  // With the checksum right: another version; more and fewer words; too wide; filled up with more.
  for (const std::vector<std::uint8_t>& body :
       std::vector<std::vector<std::uint8_t>>{{1, 1, 1, 1},
                                              {2, 1, 1},
                                              {2, 1, 1, 1, 0},
                                              {2, 9, 1, 1},
                                              {2, 1, 33, 1, 0, 0, 0, 0},
                                              {2, 1, 1, 2},
                                              {2, 0xff, 0xff, 0xff, 0xff, 0x0f, 0},
                                              {2},
                                              {}}) {
    std::vector<std::uint8_t> whole = body;
    PutValue(whole, Crc32(body));
    ExpectError(ErrorCode::kCorrupt, "blob_corrupt", [&] { DecodeWords(whole, 1000); });
  }
}

TEST(BlobCodec, CodebooksComeBackAndDamageIsNoticed) {
  const Descriptors words = Descriptors::Float(2, 3);
  Codebook book;
  book.code_bytes = 1;
  book.part_dim = 2;
  for (int i = 0; i < 12; ++i) book.rotation.push_back(0.25F * static_cast<float>(i));
  for (int i = 0; i < 64; ++i) book.centroids.push_back(-0.5F * static_cast<float>(i));
  const std::vector<std::uint8_t> blob = EncodeCodebook(book);
  const Codebook back = DecodeCodebook(blob, words);
  EXPECT_EQ(back.code_bytes, 1);
  EXPECT_EQ(back.part_dim, 2);
  EXPECT_EQ(back.rotation, book.rotation);
  EXPECT_EQ(back.centroids, book.centroids);
  for (std::size_t i = 0; i < blob.size(); ++i) {
    std::vector<std::uint8_t> damaged = blob;
    damaged[i] ^= 0x10;
    ExpectError(ErrorCode::kCorrupt, "blob_corrupt", [&] { DecodeCodebook(damaged, words); });
  }
  ExpectError(ErrorCode::kCorrupt, "blob_corrupt",
              [&] { DecodeCodebook(blob, Descriptors::Float(2, 9)); });
  ExpectError(ErrorCode::kCorrupt, "blob_corrupt",
              [&] { DecodeCodebook(EncodeCodebook({}), words); });
}

}  // namespace
}  // namespace pliant
