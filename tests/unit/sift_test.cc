// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Keypoint detection against OpenCV's, and its kernels of every instruction set against plain
// loops.
#include "descriptor/features/sift.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <opencv2/features2d.hpp>

#include "descriptor/features/sift_kernels.h"
#include "descriptor/image/cv_image.h"
#include "tests/unit/image_files.h"

namespace pliant::sift {
namespace {

constexpr double kContrast = 0.04;
constexpr int kAll = 100'000;

std::vector<Keypoint> OfOpenCv(const Image& image, double contrast) {
  std::vector<cv::KeyPoint> found;
  cv::SIFT::create(0, kLayers, contrast)->detect(ViewAsMat(image), found);
  std::vector<Keypoint> keypoints;
  for (const cv::KeyPoint& k : found) {
    keypoints.push_back({k.pt.x, k.pt.y, k.size, k.angle, k.response, k.octave});
  }
  return keypoints;
}

bool Alike(const Keypoint& a, const Keypoint& b) {
  constexpr float kPixels = 0.02F;
  constexpr float kDegrees = 1;
  constexpr int kOctaveAndLayer = 0xFFFF;  // the rest is the rounded offset between layers
  const float turn = std::abs(a.angle - b.angle);
  return std::abs(a.x - b.x) < kPixels && std::abs(a.y - b.y) < kPixels &&
         std::abs(a.size - b.size) < 0.02F * a.size && std::abs(a.response - b.response) < 1e-3F &&
         std::min(turn, 360 - turn) < kDegrees &&
         (a.octave & kOctaveAndLayer) == (b.octave & kOctaveAndLayer);
}

int CountAlike(const std::vector<Keypoint>& wanted, std::vector<Keypoint> found) {
  int count = 0;
  for (const Keypoint& k : wanted) {
    const auto at = std::find_if(found.begin(), found.end(),
                                 [&](const Keypoint& other) { return Alike(k, other); });
    if (at == found.end()) continue;
    found.erase(at);
    ++count;
  }
  return count;
}

// Wider than a tile, with a height of no round number.
Image Large() { return CopyFromMat(testing::NoiseImage(700, 403, 7)); }

TEST(Sift, FindsWhatOpenCvFinds) {
  const Image image = Large();
  for (const double contrast : {kContrast, kContrast / 2}) {
    const auto wanted = OfOpenCv(image, contrast);
    const auto found =
        Detect(image, {.max_keypoints = kAll, .keep_repeated_orientations = true}, contrast, 1);
    ASSERT_GT(wanted.size(), 500U);
    const auto most = static_cast<double>(std::max(wanted.size(), found.size()));
    EXPECT_GE(CountAlike(wanted, found), 0.995 * most) << contrast;
  }
}

TEST(Sift, ThreadsDoNotChangeTheResult) {
  const Image image = Large();
  const auto alone = Detect(image, {}, kContrast, 1);
  for (const int threads : {2, 3, 8}) EXPECT_EQ(Detect(image, {}, kContrast, threads), alone);
}

TEST(Sift, TakesImagesOfEverySmallSize) {
  for (int width = 1; width <= 40; width += 3) {
    for (int height = 1; height <= 40; ++height) {
      const Image image = CopyFromMat(testing::NoiseImage(width, height, 9));
      const auto wanted = OfOpenCv(image, kContrast);
      const auto found =
          Detect(image, {.max_keypoints = kAll, .keep_repeated_orientations = true}, kContrast, 2);
      const auto most = static_cast<int>(std::max(wanted.size(), found.size()));
      EXPECT_GE(CountAlike(wanted, found), most - 1 - most / 20) << width << " x " << height;
    }
  }
}

TEST(Sift, FindsOnlyWhatLiesInside) {
  const Image image = Large();
  const Region part{.x = 100, .y = 50, .width = 300, .height = 200};
  const auto inside = Detect(image, {.max_keypoints = kAll, .inside = part}, kContrast, 1);
  std::vector<Keypoint> wanted;
  for (const Keypoint& k : Detect(image, {.max_keypoints = kAll}, kContrast, 1)) {
    if (Contains(part, k.x, k.y)) wanted.push_back(k);
  }
  EXPECT_EQ(inside, wanted);
  EXPECT_GT(inside.size(), 20U);
}

class SiftKernelsTest : public ::testing::TestWithParam<const Kernels*> {
 protected:
  std::vector<float> Random(int count) {
    std::uniform_real_distribution<float> uniform(0, 255);
    std::vector<float> values(static_cast<std::size_t>(count));
    for (float& value : values) value = uniform(random_);
    return values;
  }

 private:
  std::mt19937 random_{5};
};

TEST_P(SiftKernelsTest, BlurAlongColumnsAndRows) {
  constexpr int kWidth = 112;  // seven vectors of the widest set
  for (const int radius : {0, 1, 5, 12}) {
    const std::vector<float> taps = Random(radius + 1);
    const auto blurred = [&](const auto& at) {
      double sum = static_cast<double>(taps[0]) * at(0);
      for (int j = 1; j <= radius; ++j) {
        sum += static_cast<double>(taps[static_cast<std::size_t>(j)]) * (at(-j) + at(j));
      }
      return sum;
    };
    std::vector<std::vector<float>> image(static_cast<std::size_t>(2 * radius + 2));
    std::vector<const float*> rows;
    for (auto& row : image) rows.push_back((row = Random(kWidth)).data());
    std::vector<float> upper(kWidth);
    std::vector<float> lower(kWidth);
    GetParam()->blur_columns(rows.data(), taps.data(), radius, 0, kWidth, upper.data(),
                             lower.data());
    for (int x = 0; x < kWidth; ++x) {
      for (const int row : {0, 1}) {
        const double wanted = blurred([&](int j) {
          return static_cast<double>(rows[static_cast<std::size_t>(radius + row + j)][x]);
        });
        EXPECT_NEAR((row == 0 ? upper : lower)[static_cast<std::size_t>(x)], wanted, 1e-5 * wanted);
      }
    }
    const std::vector<float> row = Random(kWidth + 2 * radius);
    GetParam()->blur_row(row.data() + radius, taps.data(), radius, kWidth, upper.data());
    for (int x = 0; x < kWidth; ++x) {
      const double wanted = blurred([&](int j) {
        return static_cast<double>(row[static_cast<std::size_t>(radius + x + j)]);
      });
      EXPECT_NEAR(upper[static_cast<std::size_t>(x)], wanted, 1e-5 * wanted);
    }
  }
}

TEST_P(SiftKernelsTest, FindExtrema) {
  constexpr int kWidth = 48;
  constexpr int kStride = 80;
  constexpr float kThreshold = 20;
  std::vector<std::vector<float>> values(std::size_t{3} * kLevels);
  LevelRows rows;
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = Random(kStride);
    rows[i / 3][i % 3] = values[i].data();
  }
  std::vector<float> scratch(std::size_t{3} * kLayers * kStride);
  std::vector<std::int32_t> found(kStride);
  GetParam()->find_extrema(rows, kThreshold, kWidth, kStride, scratch.data(), found.data());
  int extrema = 0;
  for (int x = 1; x < kWidth - 1; ++x) {
    for (std::size_t layer = 1; layer <= kLayers; ++layer) {
      const auto difference = [&](std::size_t of, std::size_t row, int column) {
        return rows[of + 1][row][column] - rows[of][row][column];
      };
      const float value = difference(layer, 1, x);
      bool highest = value > kThreshold;
      bool lowest = value < -kThreshold;
      for (std::size_t of = layer - 1; of <= layer + 1; ++of) {
        for (std::size_t row = 0; row < 3; ++row) {
          for (int column = x - 1; column <= x + 1; ++column) {
            highest = highest && value >= difference(of, row, column);
            lowest = lowest && value <= difference(of, row, column);
          }
        }
      }
      const bool is = (found[static_cast<std::size_t>(x)] >> (layer - 1) & 1) != 0;
      EXPECT_EQ(is, highest || lowest) << x << " " << layer;
      extrema += is ? 1 : 0;
    }
  }
  EXPECT_GT(extrema, 2);
}

INSTANTIATE_TEST_SUITE_P(All, SiftKernelsTest, ::testing::ValuesIn(UsableKernels()),
                         [](const auto& set) { return std::string(set.param->name); });

}  // namespace
}  // namespace pliant::sift
