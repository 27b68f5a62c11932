// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/plot/plot.h"

#include <cmath>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "descriptor/plot/axis.h"
#include "descriptor/plot/drawing.h"
#include "descriptor/plot/sheet.h"

namespace pliant::plot {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::Pointwise;

constexpr int kWidth = 920;

bool Shows(const Image& image, int x, int y, Colour colour) {
  const std::uint8_t* p = image.pixels.data() + 3 * (static_cast<std::size_t>(y) * image.width + x);
  return std::abs(p[0] - colour.red) + std::abs(p[1] - colour.green) +
             std::abs(p[2] - colour.blue) <
         60;
}

// Columns with a pixel of the colour, ascending, as runs [first, last].
std::vector<std::pair<int, int>> ColumnRuns(const Image& image, Colour colour) {
  std::vector<std::pair<int, int>> runs;
  for (int x = 0; x < image.width; ++x) {
    bool any = false;
    for (int y = 0; y < image.height && !any; ++y) any = Shows(image, x, y, colour);
    if (!any) continue;
    if (runs.empty() || runs.back().second != x - 1) {
      runs.emplace_back(x, x);
    } else {
      runs.back().second = x;
    }
  }
  return runs;
}

int LongestRun(const Image& image, int y, Colour colour) {
  int longest = 0;
  int run = 0;
  for (int x = 0; x < image.width; ++x) {
    run = Shows(image, x, y, colour) ? run + 1 : 0;
    longest = std::max(longest, run);
  }
  return longest;
}

// Widths of the boxes of the colour that are at least `least` wide, from the top.
std::vector<int> BarLengths(const Image& image, Colour colour, int least) {
  std::vector<int> lengths;
  bool inside = false;
  for (int y = 0; y < image.height; ++y) {
    const int length = LongestRun(image, y, colour);
    if (length >= least && !inside) lengths.push_back(length);
    inside = length >= least;
  }
  return lengths;
}

LineChart Chart(std::vector<Line> lines) {
  LineChart chart;
  chart.x_label = "x";
  chart.y_label = "y";
  chart.lines = std::move(lines);
  return chart;
}

Line Level(const std::string& name, double y, int points = 20) {
  Line line{name, {}, {}};
  for (int i = 1; i <= points; ++i) line.points.push_back({static_cast<double>(i), y});
  return line;
}

TEST(Axis, PlacesValuesBetweenItsEnds) {
  const Axis linear(0, 4, 100, 300);
  EXPECT_DOUBLE_EQ(linear(1), 150);
  EXPECT_DOUBLE_EQ(linear(9), 300);
  const Axis upwards(0, 1, 300, 100);
  EXPECT_DOUBLE_EQ(upwards(0.25), 250);
  const Axis logarithmic(0.25, 4, 0, 400, true);
  EXPECT_NEAR(logarithmic(1), 200, 1e-9);
  EXPECT_NEAR(logarithmic(2), 300, 1e-9);
  EXPECT_DOUBLE_EQ(Axis(3, 3, 0, 10)(3), 5);
}

TEST(Axis, TicksAreRoundNumbers) {
  EXPECT_THAT(NiceTicks(0, 1, 6), Pointwise(DoubleNear(1e-12), {0.0, 0.2, 0.4, 0.6, 0.8, 1.0}));
  EXPECT_THAT(NiceTicks(0, 37, 5), Pointwise(DoubleNear(1e-9), {0.0, 10.0, 20.0, 30.0}));
  EXPECT_THAT(NiceTicks(-0.4, 0.4, 4), Pointwise(DoubleNear(1e-9), {-0.4, -0.2, 0.0, 0.2, 0.4}));
  EXPECT_THAT(NiceTicks(7, 7, 4), ElementsAre(7));
  for (double span = 1e-4; span < 1e5; span *= 1.7) {
    for (const int most : {3, 6, 10}) {
      const double step = NiceStep(span, most);
      EXPECT_GE(step * most, span * (1 - 1e-9));
      EXPECT_LE(step * most, 2.51 * span);
      const double digit = step / std::pow(10.0, std::floor(std::log10(step * (1 + 1e-9))));
      EXPECT_TRUE(std::set<long>({1, 2, 5}).contains(std::lround(digit))) << step;
    }
  }
}

TEST(Axis, NumbersHaveTheDecimalsTheyNeed) {
  EXPECT_THAT(TickTexts({0, 0.2, 0.4}), ElementsAre("0.0", "0.2", "0.4"));
  EXPECT_EQ(TickTexts(NiceTicks(0, 1, 6)).front(), "0.0");
  EXPECT_THAT(TickTexts({0, 30, 60}), ElementsAre("0", "30", "60"));
  EXPECT_THAT(TickTexts({0.25, 0.5, 1.0 / std::sqrt(2.0)}), ElementsAre("0.25", "0.50", "0.71"));
  EXPECT_THAT(TickTexts({0, 0.002}), ElementsAre("0.000", "0.002"));
}

TEST(Plot, CurvesAreSeenFromEndToEndBesideTheirLegend) {
  for (double y = 0.05; y <= 1.0; y += 0.05) {
    const Image image = DrawFigure({"Levels", "", {}, {Chart({Level("level", y)})}});
    ASSERT_EQ(image.width, kWidth);
    const auto runs = ColumnRuns(image, DistinctColour(0));
    ASSERT_EQ(runs.size(), 2U) << "at " << y << ": the curve, then its sample in the legend";
    EXPECT_GT(runs[0].second - runs[0].first, kWidth / 2);
    EXPECT_GT(runs[1].first, runs[0].second + 15);
  }
}

TEST(Plot, ANameHasOneColourInAllCharts) {
  const LineChart both = Chart({Level("a", 0.2), Level("b", 0.6)});
  const LineChart second = Chart({Level("b", 0.5), Level("c", 0.9)});
  const Image image = DrawFigure({"", "", {}, {both, second}});
  // Left chart and legend; both charts and legend; right chart and legend.
  EXPECT_EQ(ColumnRuns(image, DistinctColour(0)).size(), 2U);
  EXPECT_EQ(ColumnRuns(image, DistinctColour(1)).size(), 3U);
  EXPECT_EQ(ColumnRuns(image, DistinctColour(2)).size(), 2U);
  EXPECT_LT(ColumnRuns(image, DistinctColour(0))[0].second, kWidth / 2);
  EXPECT_GT(ColumnRuns(image, DistinctColour(2))[0].first, kWidth / 3);
  const Image four = DrawFigure({"", "", {}, {both, both, both, second}});
  EXPECT_GT(four.height, image.height + 250);
}

TEST(Plot, HigherValuesStandHigher) {
  const auto row = [](const Image& image, Colour colour) {
    for (int y = 0; y < image.height; ++y) {
      if (LongestRun(image, y, colour) > kWidth / 2) return y;
    }
    return -1;
  };
  LineChart chart = Chart({Level("a", 0.25), Level("b", 0.5), Level("c", 1.0)});
  chart.y_top = 1;
  const Image image = DrawFigure({"", "", {}, {chart}});
  const int a = row(image, DistinctColour(0));
  const int b = row(image, DistinctColour(1));
  const int c = row(image, DistinctColour(2));
  ASSERT_GT(c, 0);
  EXPECT_GT(a, b);
  EXPECT_NEAR(b - c, 2 * (a - b), 3);
}

TEST(Plot, SpreadsAreWhiskers) {
  Line line = Level("a", 0.5, 3);
  const auto marked = [&] {
    const Image image = DrawFigure({"", "", {}, {Chart({line})}});
    int count = 0;
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) count += Shows(image, x, y, DistinctColour(0)) ? 1 : 0;
    }
    return count;
  };
  line.spreads = {0, 0, 0.001};
  const int without = marked();
  line.spreads = {0.2, 0.2, 0.2};
  EXPECT_GT(marked(), without + 100);
}

TEST(Plot, BarsAreAsLongAsTheirValues) {
  BarChart chart;
  chart.measures = {"one", "two"};
  chart.groups = {{"first", {{0.2}, {0.4}}}, {"second", {{0.8}, {0.1}}}};
  const Image image = DrawFigure({"", "", {chart}, {}});
  const std::vector<int> one = BarLengths(image, {46, 66, 102}, 30);
  const std::vector<int> two = BarLengths(image, {124, 156, 190}, 30);
  ASSERT_EQ(one.size(), 2U);
  ASSERT_EQ(two.size(), 2U);
  EXPECT_NEAR(one[1], 8 * two[1], 9);
  EXPECT_NEAR(two[0], one[1] / 2.0, 2);
  EXPECT_NEAR(one[0], one[1] / 4.0, 2);
}

TEST(Plot, LongNamesAreCutAndChangeNoSize) {
  const std::string endless(300, 'w');
  BarChart bars;
  bars.title = endless;
  bars.measures = {endless};
  bars.groups = {{endless, {{0.5, 0.1}}}};
  LineChart lines = Chart({Level(endless, 0.4)});
  lines.title = lines.x_label = lines.y_label = endless;
  const Image image = DrawFigure({endless, endless, {bars}, {lines}});
  EXPECT_EQ(image.width, kWidth);
  EXPECT_EQ(BarLengths(image, {46, 66, 102}, 100).size(), 1U);
  const std::string cut = Sheet::Shortened(endless, 100, 11);
  EXPECT_LE(Sheet::TextWidth(cut, 11), 100);
  EXPECT_THAT(cut, ::testing::EndsWith("w..."));
  EXPECT_EQ(Sheet::Shortened("deal", 100, 11), "deal");
  std::string umlauts;
  for (int i = 0; i < 100; ++i) umlauts += "\u00fc";
  const std::string short_umlauts = Sheet::Shortened(umlauts, 100, 11);  // whole characters
  EXPECT_EQ(short_umlauts, umlauts.substr(0, short_umlauts.size() - 3) + "...");
  EXPECT_EQ(short_umlauts.size() % 2, 1U);
}

TEST(Plot, DrawsWhatIsLittleOrMuch) {
  EXPECT_GT(DrawFigure({"", "", {}, {Chart({{"a", {{3, 7}}, {}}})}}).height, 300);  // one point
  LineChart scales = Chart({{"a", {{0.25, 0.1}, {1, -0.3}, {4, 0}}, {}}, {"none", {}, {}}});
  scales.logarithmic = true;
  EXPECT_GT(DrawFigure({"", "", {}, {scales}}).height, 300);
  EXPECT_GT(DrawFigure({"", "", {}, {Chart({Level("a", 0, 5000)})}}).height, 300);
  std::vector<Line> many;
  for (int i = 0; i < 60; ++i) many.push_back(Level(std::to_string(i), 1 + i));
  EXPECT_GT(DrawFigure({"", "", {}, {Chart(many)}}).height, 60 * 20);  // the legend has its room
  BarChart nothing{"", {"zero"}, {{"a", {{0}}}}};
  EXPECT_GT(DrawFigure({"", "", {nothing}, {}}).height, 80);
}

TEST(Plot, RefusesWhatCannotBeDrawn) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](const Figure& figure) {
    try {
      DrawFigure(figure);
    } catch (const Error& error) {
      return error.code() == ErrorCode::kInvalidArgument && error.reason() == "plot_invalid";
    }
    return false;
  };
  EXPECT_TRUE(refused({"", "", {}, {}}));
  EXPECT_TRUE(refused({"", "", {}, {Chart({})}}));
  EXPECT_TRUE(refused({"", "", {}, {Chart({{"a", {{1, nan}}, {}}})}}));
  EXPECT_TRUE(refused({"", "", {}, {Chart({{"a", {{1, 2}}, {1, 2}}})}}));
  LineChart scales = Chart({{"a", {{0, 1}, {1, 1}}, {}}});
  scales.logarithmic = true;
  EXPECT_TRUE(refused({"", "", {}, {scales}}));
  EXPECT_TRUE(refused({"", "", {{"", {"m"}, {{"a", {{-1}}}}}}, {}}));
  EXPECT_TRUE(refused({"", "", {{"", {"m", "n"}, {{"a", {{1}}}}}}, {}}));
  EXPECT_TRUE(refused({"", "", {{"", {"m"}, {}}}, {}}));
}

}  // namespace
}  // namespace pliant::plot
