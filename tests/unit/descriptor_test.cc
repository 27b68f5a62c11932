// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What every descriptor behind the interface must do, and the extractor that wraps them.
#include "descriptor/features/descriptor.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "descriptor/base/error.h"
#include "descriptor/base/sha256.h"
#include "descriptor/image/cv_image.h"
#include "tests/unit/image_files.h"

namespace pliant {
namespace {

double Distance(const Descriptors& a, std::size_t i, const Descriptors& b, std::size_t j) {
  double sum = 0;
  for (int c = 0; c < a.dim; ++c) {
    if (a.kind == DescriptorKind::kFloat) {
      sum += std::pow(a.float_row(i)[c] - b.float_row(j)[c], 2);
    } else {
      sum += std::popcount(static_cast<unsigned>(a.binary_row(i)[c] ^ b.binary_row(j)[c]));
    }
  }
  return a.kind == DescriptorKind::kFloat ? std::sqrt(sum) : sum;
}

// Share of rows of `a` whose nearest row of `b` is the one with the same number.
double SelfMatchShare(const Descriptors& a, const Descriptors& b) {
  std::size_t right = 0;
  for (std::size_t i = 0; i < a.rows; ++i) {
    std::size_t nearest = 0;
    double best = std::numeric_limits<double>::infinity();
    for (std::size_t j = 0; j < b.rows; ++j) {
      const double distance = Distance(a, i, b, j);
      if (distance < best) {
        best = distance;
        nearest = j;
      }
    }
    right += nearest == i ? 1 : 0;
  }
  return static_cast<double>(right) / static_cast<double>(a.rows);
}

class EveryDescriptor : public ::testing::TestWithParam<std::string> {
 protected:
  // Made once a name: loading DEAL's weights takes longer than using them here.
  static std::shared_ptr<const Descriptor> Shared(const std::string& name) {
    static std::map<std::string, std::shared_ptr<const Descriptor>> made;
    if (!made.contains(name)) made[name] = MakeDescriptor(name);
    return made[name];
  }

  std::shared_ptr<const Descriptor> descriptor_ = Shared(GetParam());
  Image image_ = CopyFromMat(testing::NoiseImage(200, 160, 11));
  std::vector<Keypoint> keypoints_ = DetectKeypoints(image_, {.max_keypoints = 100});
};

TEST_P(EveryDescriptor, HasOneRowAKeypointAndSaysWhatItIs) {
  const DescriptorInfo& info = descriptor_->info();
  EXPECT_EQ(info.name, GetParam());
  EXPECT_TRUE(info.model_id.starts_with(GetParam() + ":")) << info.model_id;
  const Descriptors rows = descriptor_->Describe(image_, keypoints_, 1);
  EXPECT_EQ(rows.rows, keypoints_.size());
  EXPECT_EQ(rows.kind, info.kind);
  EXPECT_EQ(rows.dim, info.dim);
  const std::size_t expected = rows.rows * static_cast<std::size_t>(rows.dim);
  EXPECT_EQ(rows.floats.size(), info.kind == DescriptorKind::kFloat ? expected : 0);
  EXPECT_EQ(rows.bytes.size(), info.kind == DescriptorKind::kBinary ? expected : 0);
  for (const float value : rows.floats) ASSERT_TRUE(std::isfinite(value));
}

TEST_P(EveryDescriptor, RowsFollowTheKeypointsOrder) {
  const Descriptors forward = descriptor_->Describe(image_, keypoints_, 1);
  std::vector<Keypoint> reversed(keypoints_.rbegin(), keypoints_.rend());
  const Descriptors backward = descriptor_->Describe(image_, reversed, 1);
  for (std::size_t i = 0; i < forward.rows; ++i) {
    EXPECT_NEAR(Distance(forward, i, backward, forward.rows - 1 - i), 0, 1e-4);
  }
}

TEST_P(EveryDescriptor, FindsItselfInABrighterNoisierImage) {
  cv::Mat changed = ViewAsMat(image_).clone();
  cv::Mat noise(changed.size(), CV_16S);
  cv::RNG(5).fill(noise, cv::RNG::NORMAL, 8, 4);
  cv::add(changed, noise, changed, cv::noArray(), CV_8U);
  const Descriptors a = descriptor_->Describe(image_, keypoints_, 1);
  const Descriptors b = descriptor_->Describe(CopyFromMat(changed), keypoints_, 1);
  EXPECT_GT(SelfMatchShare(a, b), 0.95);
}

// Rows that match across a turn by 35 degrees and a halving, the keypoints carried along.
TEST_P(EveryDescriptor, TurnsAndShrinksWithTheKeypoint) {
  cv::Mat image;  // of blobs that are still there at half the size
  cv::resize(testing::NoiseImage(180, 180, 21), image, {360, 360}, 0, 0, cv::INTER_CUBIC);
  const cv::Mat turn = cv::getRotationMatrix2D({179.5F, 179.5F}, 35, 1);
  cv::Mat turned, halved;
  cv::warpAffine(image, turned, turn, image.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT_101);
  cv::resize(image, halved, {180, 180}, 0, 0, cv::INTER_AREA);
  std::vector<Keypoint> here, in_turned, in_halved;
  for (Keypoint k : DetectKeypoints(CopyFromMat(image), {.max_keypoints = 300})) {
    if (std::hypot(k.x - 179.5, k.y - 179.5) > 110 || k.size < 7) continue;
    here.push_back(k);
    Keypoint moved = k;
    const auto* m = turn.ptr<double>(0);
    moved.x = static_cast<float>(m[0] * k.x + m[1] * k.y + m[2]);
    moved.y = static_cast<float>(m[3] * k.x + m[4] * k.y + m[5]);
    moved.angle = std::fmod(k.angle - 35 + 360, 360.0F);
    in_turned.push_back(moved);
    moved = k;
    moved.x = (k.x + 0.5F) / 2 - 0.5F;
    moved.y = (k.y + 0.5F) / 2 - 0.5F;
    moved.size = k.size / 2;
    moved.octave = (k.octave & ~0xFF) | ((k.octave - 1) & 0xFF);  // SIFT's own level
    in_halved.push_back(moved);
  }
  ASSERT_GT(here.size(), 40U);
  const Descriptors rows = descriptor_->Describe(CopyFromMat(image), here, 1);
  EXPECT_GT(SelfMatchShare(rows, descriptor_->Describe(CopyFromMat(turned), in_turned, 1)), 0.85);
  EXPECT_GT(SelfMatchShare(rows, descriptor_->Describe(CopyFromMat(halved), in_halved, 1)), 0.6);
}

TEST_P(EveryDescriptor, KeypointsAnywhereAndOfAnySizeKeepTheirRows) {
  std::vector<Keypoint> keypoints;
  for (const float size : {2.0F, 9.0F, 60.0F, 900.0F}) {
    for (const auto& [x, y] : {std::pair{0.0F, 0.0F},
                               {199.0F, 0.0F},
                               {100.5F, 80.25F},
                               {-0.4F, 159.4F},
                               {3.0F, 157.0F}}) {
      keypoints.push_back({.x = x, .y = y, .size = size, .angle = 70, .octave = 1 << 8});
    }
  }
  const Descriptors together = descriptor_->Describe(image_, keypoints, 1);
  ASSERT_EQ(together.rows, keypoints.size());
  for (const float value : together.floats) ASSERT_TRUE(std::isfinite(value));
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const Descriptors alone = descriptor_->Describe(image_, {&keypoints[i], 1}, 1);
    // A wider border moves positions by a rounding error, which may turn a bit over.
    EXPECT_NEAR(Distance(together, i, alone, 0), 0,
                alone.kind == DescriptorKind::kBinary ? 3 : 1e-3)
        << "keypoint " << i;
  }
}

TEST_P(EveryDescriptor, NoKeypointsGiveNoRows) {
  const Descriptors rows = descriptor_->Describe(image_, {}, 1);
  EXPECT_EQ(rows.rows, 0U);
  EXPECT_EQ(rows.dim, descriptor_->info().dim);
}

TEST_P(EveryDescriptor, RefusesColour) {
  EXPECT_THROW(descriptor_->Describe({4, 4, 3, std::vector<std::uint8_t>(48)}, keypoints_, 1),
               Error);
}

INSTANTIATE_TEST_SUITE_P(Names, EveryDescriptor, ::testing::ValuesIn(DescriptorNames()),
                         [](const auto& parameter) {
                           std::string name = parameter.param;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

TEST(RootSift, HasUnitLength) {
  const Image image = CopyFromMat(testing::NoiseImage(200, 160, 12));
  const Descriptors rows = MakeDescriptor("rootsift")->Describe(image, DetectKeypoints(image), 1);
  ASSERT_GT(rows.rows, 50U);
  for (std::size_t i = 0; i < rows.rows; ++i) {
    double sum = 0;
    for (const float value : rows.float_row(i)) sum += value * value;
    EXPECT_NEAR(sum, 1, 1e-4);
  }
}

TEST(MakeDescriptor, NamesTheKnownOnes) {
  try {
    MakeDescriptor("surf");
    FAIL() << "made a descriptor of an unknown name";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kInvalidArgument);
    EXPECT_NE(std::string(e.what()).find("rootsift"), std::string::npos);
  }
}

TEST(MakeDescriptor, SaysWhichWeightFileIsMissing) {
  try {
    MakeDescriptor("deal", {.model_path = "/nonexistent/weights.safetensors"});
    FAIL() << "made a descriptor without weights";
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("/nonexistent/weights.safetensors"), std::string::npos);
  }
}

TEST(FeatureExtractor, GivesKeypointsInPixelsOfTheOriginal) {
  cv::Mat large;
  cv::resize(testing::NoiseImage(400, 300, 13), large, {}, 4, 4, cv::INTER_CUBIC);
  const auto bytes = testing::EncodeAs(large, ".png");
  ExtractionOptions options;
  options.decode.max_side_px = 400;
  ExtractionTimings timings;
  const Features features =
      FeatureExtractor(MakeDescriptor("orb"), options).Extract(bytes, 1, &timings);
  EXPECT_EQ(features.width, 1600);
  EXPECT_EQ(features.height, 1200);
  EXPECT_EQ(features.model_id, "orb:1");
  EXPECT_EQ(features.keypoints.size(), features.descriptors.rows);
  EXPECT_GT(timings.describe_ms, 0);
  float furthest = 0;
  for (const Keypoint& k : features.keypoints) {
    furthest = std::max(furthest, k.x);
    EXPECT_GE(k.x, -0.5F);
    EXPECT_LE(k.x, 1599.5F);
  }
  EXPECT_GT(furthest, 800.0F);
}

TEST(FeatureExtractor, DecodedImagesGiveWhatEncodedOnesDo) {
  const Image grey = CopyFromMat(testing::NoiseImage(300, 200, 4));
  Image colour{grey.width, grey.height, 3, {}};
  for (const std::uint8_t value : grey.pixels) colour.pixels.insert(colour.pixels.end(), 3, value);
  ExtractionOptions options;
  for (const int max_side : {0, 150}) {
    options.decode.max_side_px = max_side;
    const FeatureExtractor extractor(MakeDescriptor("rootsift"), options);
    const Features encoded = extractor.Extract(EncodePng(grey), 1);
    ASSERT_GT(encoded.keypoints.size(), 20U);
    for (const Image& image : {grey, colour}) {
      const Features decoded = extractor.ExtractFrom(image, 1);
      EXPECT_EQ(decoded.width, 300);
      EXPECT_EQ(decoded.keypoints, encoded.keypoints);
      EXPECT_EQ(decoded.descriptors.floats, encoded.descriptors.floats);
      EXPECT_EQ(decoded.model_id, encoded.model_id);
    }
  }
  const FeatureExtractor extractor(MakeDescriptor("orb"), options);
  EXPECT_THROW(extractor.ExtractFrom(Image{}, 1), Error);
}

TEST(FeatureExtractor, LowContrastKeypointsCountWhereSmallImagesAreEnlarged) {
  const Image grey = CopyFromMat(testing::NoiseImage(300, 200, 4));
  const FeatureExtractor plain(MakeDescriptor("orb"), {});
  EXPECT_EQ(plain.ExtractFrom(grey, 1).keypoints, DetectKeypoints(grey));
  const auto enlarged_below = [&](int keypoints) {
    ExtractionOptions options;
    options.enlarge_below = keypoints;
    return FeatureExtractor(MakeDescriptor("orb"), options).ExtractFrom(grey, 1).keypoints;
  };
  const auto low_contrast = DetectLowContrastKeypoints(grey);
  EXPECT_EQ(enlarged_below(1), low_contrast) << "this one is not enlarged";
  EXPECT_GT(enlarged_below(1 << 20).size(), low_contrast.size());
  const auto few = static_cast<int>(low_contrast.size()) + 20;
  EXPECT_EQ(enlarged_below(few).size(), low_contrast.size() + 20) << "only as many as are missing";
}

TEST(FeatureExtractor, FlatImageHasNoRows) {
  const auto bytes = testing::EncodeAs(cv::Mat(64, 64, CV_8UC1, cv::Scalar(9)), ".png");
  const Features features = FeatureExtractor(MakeDescriptor("orb"), {}).Extract(bytes, 1);
  EXPECT_EQ(features.descriptors.rows, 0U);
}

TEST(Sha256Hex, MatchesTheStandardsExample) {
  EXPECT_EQ(Sha256Hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

}  // namespace
}  // namespace pliant
