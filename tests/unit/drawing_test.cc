// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/plot/drawing.h"

#include <cstdlib>
#include <limits>
#include <set>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

Colour At(const Image& image, int x, int y) {
  const std::uint8_t* p = image.pixels.data() + 3 * (static_cast<std::size_t>(y) * image.width + x);
  return {p[0], p[1], p[2]};
}

// Smoothed lines are a little paler than their colour.
bool IsNearly(Colour a, Colour b) {
  return std::abs(a.red - b.red) + std::abs(a.green - b.green) + std::abs(a.blue - b.blue) < 90;
}

int Changed(const Image& image) {
  int changed = 0;
  for (const std::uint8_t value : image.pixels) changed += value != 0 ? 1 : 0;
  return changed;
}

TEST(Drawing, LinesLieWhereTheyAreAskedFor) {
  Image image = BlankPicture(40, 30);
  DrawLine(image, {5, 10}, {30, 10}, colours::kRed);
  EXPECT_TRUE(IsNearly(At(image, 20, 10), colours::kRed));
  EXPECT_EQ(At(image, 20, 13), colours::kBlack);
  const Vec2 triangle[] = {{2, 2}, {37, 2}, {20, 27}};
  Image open = BlankPicture(40, 30);
  DrawPolyline(open, triangle, false, colours::kWhite);
  Image closed = BlankPicture(40, 30);
  DrawPolyline(closed, triangle, true, colours::kWhite);
  EXPECT_TRUE(IsNearly(At(open, 20, 2), colours::kWhite));
  EXPECT_GT(Changed(closed), Changed(open));
  Image filled = BlankPicture(40, 30);
  FillConvex(filled, triangle, colours::kYellow);
  EXPECT_EQ(At(filled, 20, 10), colours::kYellow);
  EXPECT_EQ(At(filled, 4, 20), colours::kBlack);
  DrawDot(image, {20, 20}, 3, colours::kGreen);
  EXPECT_EQ(At(image, 20, 20), colours::kGreen);
  EXPECT_EQ(At(image, 20, 25), colours::kBlack);
}

TEST(Drawing, NothingOutsideThePictureDoesHarm) {
  Image image = BlankPicture(20, 20);
  const double huge = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  DrawLine(image, {-1e9, -1e9}, {huge, 1e300}, colours::kWhite);
  DrawLine(image, {nan, 3}, {4, nan}, colours::kWhite);
  DrawDot(image, {1e12, -5}, 4, colours::kWhite);
  DrawText(image, 500, -40, "far away", colours::kWhite);
  FillBox(image, 15, 15, 1000, 1000, colours::kBlue);
  EXPECT_EQ(At(image, 19, 19), colours::kBlue);
  FillBox(image, -50, -50, 10, 10, colours::kRed);
  PastePicture(image, BlankPicture(8, 8, colours::kRed), -4, 16);
  EXPECT_EQ(At(image, 3, 19), colours::kRed);
  EXPECT_EQ(At(image, 4, 19), colours::kBlack);
  PastePicture(image, BlankPicture(8, 8, colours::kRed), 100, 100);
}

TEST(Drawing, PicturesArePastedInColour) {
  Image image = BlankPicture(10, 10, colours::kYellow);
  PastePicture(image, {2, 2, 1, {10, 20, 30, 40}}, 3, 4);
  EXPECT_EQ(At(image, 3, 4), (Colour{10, 10, 10}));
  EXPECT_EQ(At(image, 4, 5), (Colour{40, 40, 40}));
  EXPECT_EQ(At(image, 5, 5), colours::kYellow);
}

TEST(Drawing, WordsHaveTheirWidth) {
  EXPECT_GT(TextWidth("inliers", 20), TextWidth("inliers", 10));
  EXPECT_GT(TextWidth("inliers 12"), TextWidth("inliers"));
  Image image = BlankPicture(200, 30);
  DrawText(image, 5, 20, "found", colours::kWhite, 14);
  EXPECT_GT(Changed(image), 60);
}

TEST(Drawing, ColoursDiffer) {
  std::set<int> seen;
  for (std::size_t i = 0; i < 9; ++i) {
    const Colour c = DistinctColour(i);
    seen.insert(c.red << 16 | c.green << 8 | c.blue);
  }
  EXPECT_EQ(seen.size(), 9U);
  EXPECT_EQ(DistinctColour(9), DistinctColour(0));
}

TEST(Drawing, RefusesGreyAndEmpty) {
  Image grey{4, 4, 1, std::vector<std::uint8_t>(16)};
  EXPECT_THROW(DrawLine(grey, {0, 0}, {3, 3}, colours::kRed), Error);
  Image none;
  EXPECT_THROW(DrawDot(none, {0, 0}, 1, colours::kRed), Error);
  EXPECT_THROW(BlankPicture(0, 5), Error);
  EXPECT_EQ(ToColour(grey).channels, 3);
}

}  // namespace
}  // namespace pliant
