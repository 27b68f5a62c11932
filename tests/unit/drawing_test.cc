// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/drawing/drawing.h"

#include <cstdlib>
#include <limits>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "descriptor/drawing/match_drawing.h"

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
  Image image = BlankImage(40, 30);
  DrawLine(image, {5, 10}, {30, 10}, colours::kRed);
  EXPECT_TRUE(IsNearly(At(image, 20, 10), colours::kRed));
  EXPECT_EQ(At(image, 20, 13), colours::kBlack);
  const Vec2 triangle[] = {{2, 2}, {37, 2}, {20, 27}};
  Image open = BlankImage(40, 30);
  DrawPolyline(open, triangle, false, colours::kWhite);
  Image closed = BlankImage(40, 30);
  DrawPolyline(closed, triangle, true, colours::kWhite);
  EXPECT_TRUE(IsNearly(At(open, 20, 2), colours::kWhite));
  EXPECT_GT(Changed(closed), Changed(open));
  DrawDot(image, {20, 20}, 3, colours::kGreen);
  EXPECT_EQ(At(image, 20, 20), colours::kGreen);
  EXPECT_EQ(At(image, 20, 25), colours::kBlack);
}

TEST(Drawing, NothingOutsideTheImageDoesHarm) {
  Image image = BlankImage(20, 20);
  const double huge = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  DrawLine(image, {-1e9, -1e9}, {huge, 1e300}, colours::kWhite);
  DrawLine(image, {nan, 3}, {4, nan}, colours::kWhite);
  DrawDot(image, {1e12, -5}, 4, colours::kWhite);
  DrawText(image, 500, -40, "far away", colours::kWhite);
  FillBox(image, 15, 15, 1000, 1000, colours::kBlue);
  EXPECT_EQ(At(image, 19, 19), colours::kBlue);
  FillBox(image, -50, -50, 10, 10, colours::kRed);
  PasteImage(image, BlankImage(8, 8, colours::kRed), -4, 16);
  EXPECT_EQ(At(image, 3, 19), colours::kRed);
  EXPECT_EQ(At(image, 4, 19), colours::kBlack);
  PasteImage(image, BlankImage(8, 8, colours::kRed), 100, 100);
}

TEST(Drawing, ImagesArePastedInColour) {
  Image image = BlankImage(10, 10, colours::kYellow);
  PasteImage(image, {2, 2, 1, {10, 20, 30, 40}}, 3, 4);
  EXPECT_EQ(At(image, 3, 4), (Colour{10, 10, 10}));
  EXPECT_EQ(At(image, 4, 5), (Colour{40, 40, 40}));
  EXPECT_EQ(At(image, 5, 5), colours::kYellow);
}

TEST(Drawing, WordsHaveTheirWidth) {
  EXPECT_GT(TextWidth("inliers", 20), TextWidth("inliers", 10));
  EXPECT_GT(TextWidth("inliers 12"), TextWidth("inliers"));
  EXPECT_GT(TextWidth("\xf0\x9f\x91\x92"), 0);  // in a font or not
  Image image = BlankImage(200, 30);
  DrawText(image, 5, 20, "found", colours::kWhite, 14);
  EXPECT_GT(Changed(image), 60);
}

TEST(Drawing, NothingIsWrittenWithoutFonts) {
  Image image = BlankImage(200, 30);
  DrawText(image, 5, 20, "found", colours::kWhite, 14);
  EXPECT_EQ(Changed(image) > 0, HasFonts());
  EXPECT_EQ(TextWidth("found") > 0, HasFonts());
}

Image Written(const std::string& text) {
  Image image = BlankImage(200, 60);
  DrawText(image, 10, 40, text, colours::kWhite, 20);
  return image;
}

// Of the first column (of the last, from the right) with ink: its highest pixel with ink.
int TopOfEdge(const Image& image, bool from_right) {
  for (int i = 0; i < image.width; ++i) {
    const int x = from_right ? image.width - 1 - i : i;
    for (int y = 0; y < image.height; ++y) {
      if (At(image, x, y).red > 60) return y;
    }
  }
  return -1;
}

TEST(Drawing, NamesAreWrittenAsTheyAre) {
  EXPECT_EQ(TextWidth("M\u00fctze"), TextWidth("Mutze"));
  EXPECT_EQ(TextWidth("Mu\u0308tze"), TextWidth("Mutze"));  // the dots are a character of their own
  const Image plain = Written("u");
  const Image dotted = Written("\u00fc");
  int above = 0;
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 200; ++x) {
      if (At(plain, x, y) == At(dotted, x, y)) continue;
      EXPECT_LT(y, 26) << "the letter below its dots changed at " << x;
      ++above;
    }
  }
  EXPECT_GT(above, 4);
  EXPECT_NE(Written("\u041a\u0435\u043f\u043a\u0430").pixels, Written("?????").pixels);
}

TEST(Drawing, HebrewIsWrittenFromTheRight) {
  const Image english = Written("xx.");
  EXPECT_GT(TopOfEdge(english, true), 34);
  EXPECT_LT(TopOfEdge(english, false), 34);
  const Image hebrew = Written("\u05e9\u05e9.");  // the full stop ends the line: it is on the left
  EXPECT_GT(TopOfEdge(hebrew, false), 34);
  EXPECT_LT(TopOfEdge(hebrew, true), 34);
}

TEST(Drawing, AnyBytesCanBeWritten) {
  std::string bytes;
  for (int value = 255; value >= 0; --value) bytes += static_cast<char>(value);
  Image image = BlankImage(50, 20);
  DrawText(image, 0, 15, bytes, colours::kWhite);
  DrawText(image, 0, 15, std::string(100'000, 'w'), colours::kWhite, 1);
  DrawText(image, 0, 15, "", colours::kWhite);
  DrawText(image, std::numeric_limits<int>::max(), std::numeric_limits<int>::min(), "w",
           colours::kWhite);
  EXPECT_LE(TextWidth(""), 1);
}

TEST(Drawing, ManyThreadsWriteTheSame) {
  const Image alone = Written("M\u00fctze 12");
  std::vector<Image> drawn(4);
  std::vector<std::thread> threads;
  for (Image& image : drawn) {
    threads.emplace_back([&image] {
      for (int i = 0; i < 20; ++i) {
        image = Written("M\u00fctze 12");
        TextWidth("other", 9 + i);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const Image& image : drawn) EXPECT_EQ(image.pixels, alone.pixels);
}

// The number of pixels of the sheet, from this row on, that have the colour.
int CountOf(const Image& sheet, int top, Colour colour) {
  int count = 0;
  for (int y = top; y < sheet.height; ++y) {
    for (int x = 0; x < sheet.width; ++x) count += At(sheet, x, y) == colour ? 1 : 0;
  }
  return count;
}

TEST(Drawing, MatchesHaveALegendOfWhatIsThere) {
  const Image image = BlankImage(200, 100);
  const std::vector<DrawnMatch> matches = {{{20, 20}, {30, 30}, Verdict::kTrue},
                                           {{40, 60}, {50, 70}, Verdict::kFalse}};
  const Image sheet = DrawMatches(image, image, matches, {}, "2 matches");
  constexpr Colour kTrue{0, 114, 178}, kFalse{230, 159, 0}, kUnknown{204, 121, 167};
  EXPECT_GT(CountOf(sheet, 101, kTrue), 20);
  EXPECT_GT(CountOf(sheet, 101, kFalse), 20);
  EXPECT_EQ(CountOf(sheet, 101, kUnknown), 0);
  EXPECT_EQ(CountOf(sheet, 101, colours::kYellow), 0);
  const std::vector<Vec2> outline = {{10, 10}, {90, 10}, {90, 90}};
  EXPECT_GT(CountOf(DrawMatches(image, image, matches, outline, ""), 101, colours::kYellow), 20);
}

TEST(Drawing, NoCaptionIsCut) {
  const Image image = BlankImage(150, 100);
  const std::string caption =
      "433 and 1333 keypoints, 121 mutual matches; of 80 on the object 60 are correct";
  const Image sheet = DrawMatches(image, image, {}, {}, caption);
  EXPECT_GE(sheet.height, DrawMatches(image, image, {}, {}, "short").height + 20);
  for (int y = 100; y < sheet.height; ++y) {
    EXPECT_EQ(At(sheet, sheet.width - 4, y), colours::kWhite) << "the margin at " << y;
  }
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
  EXPECT_THROW(BlankImage(0, 5), Error);
  EXPECT_EQ(ToColour(grey).channels, 3);
}

}  // namespace
}  // namespace pliant
