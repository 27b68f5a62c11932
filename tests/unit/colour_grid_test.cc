// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/colour_grid.h"

#include <array>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

namespace pliant {
namespace {

using Rgb = std::array<std::uint8_t, 3>;

// The left half of one colour, the right half of another one.
Image Halves(int width, int height, Rgb left, Rgb right) {
  Image image{width, height, 3, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Rgb& colour = x < width / 2 ? left : right;
      image.pixels.insert(image.pixels.end(), colour.begin(), colour.end());
    }
  }
  return image;
}

TEST(ColourGrid, HasTheChromaOfItsCells) {
  const ColourGrid grid = MakeColourGrid(Halves(256, 128, {255, 0, 0}, {0, 0, 255}));
  EXPECT_EQ(grid.width, kColourGridSide);
  EXPECT_EQ(grid.height, kColourGridSide / 2);
  ASSERT_EQ(grid.chroma.size(), 2U * 64 * 32);
  const auto at = [&](std::size_t x, std::size_t y, std::size_t c) {
    return static_cast<int>(grid.chroma[2 * (64 * y + x) + c]);
  };
  // CIELAB of sRGB's red is (53, 80, 67), of its blue (32, 79, -108).
  EXPECT_NEAR(at(0, 0, 0), 128 + 80, 1);
  EXPECT_NEAR(at(0, 31, 1), 128 + 67, 1);
  EXPECT_NEAR(at(63, 0, 0), 128 + 79, 1);
  EXPECT_NEAR(at(63, 31, 1), 128 - 108, 1);
}

TEST(ColourGrid, OfASmallImageHasItsPixels) {
  const ColourGrid grid = MakeColourGrid(Halves(20, 30, {255, 0, 0}, {0, 0, 255}));
  EXPECT_EQ(grid.width, 20);
  EXPECT_EQ(grid.height, 30);
}

TEST(ColourGrid, AgreesWithOpenCv) {
  cv::Mat colours(48, 64, CV_8UC3);
  cv::RNG(3).fill(colours, cv::RNG::UNIFORM, 0, 256);
  cv::Mat lab;
  cv::cvtColor(colours, lab, cv::COLOR_RGB2Lab);
  const ColourGrid grid =
      MakeColourGrid({64, 48, 3, std::vector<std::uint8_t>(colours.datastart, colours.dataend)});
  ASSERT_EQ(grid.chroma.size(), 2U * 64 * 48);
  for (int i = 0; i < 64 * 48; ++i) {
    const auto& expected = lab.at<cv::Vec3b>(i / 64, i % 64);
    ASSERT_NEAR(grid.chroma[2 * i], expected[1], 1);
    ASSERT_NEAR(grid.chroma[2 * i + 1], expected[2], 1);
  }
}

TEST(ColourGrid, GreysAreNoColours) {
  Image greys{32, 8, 3, {}};  // all of them
  for (int level = 0; level < 256; ++level) {
    greys.pixels.insert(greys.pixels.end(), 3, static_cast<std::uint8_t>(level));
  }
  EXPECT_TRUE(MakeColourGrid(greys).empty());
}

TEST(ColourGrid, IsEmptyWhereThereAreNoColours) {
  EXPECT_TRUE(MakeColourGrid({}).empty());
  EXPECT_TRUE(MakeColourGrid({40, 30, 1, std::vector<std::uint8_t>(1200, 90)}).empty());
  EXPECT_TRUE(MakeColourGrid(Halves(40, 30, {20, 20, 20}, {200, 200, 200})).empty());
  EXPECT_FALSE(MakeColourGrid(Halves(40, 30, {20, 20, 20}, {200, 180, 200})).empty());
}

}  // namespace
}  // namespace pliant
