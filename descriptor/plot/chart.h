// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One chart on a sheet. Internal to this folder.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "descriptor/plot/plot.h"
#include "descriptor/plot/sheet.h"

namespace pliant::plot {

inline constexpr int kLetters = 11;
inline constexpr int kSmallLetters = 9;
inline constexpr int kHeading = 13;
inline constexpr int kChartTitleHeight = 26;
inline constexpr int kLegendRow = 20;
inline constexpr int kLegendSymbol = 32;  // width of a symbol before its name

// The area of a chart, including its labels.
struct Area {
  double left, top, right, bottom;
};

double BarChartHeight(const BarChart& chart);
void DrawBarChart(Sheet& sheet, const BarChart& chart, const Area& area);
void DrawBarLegend(Sheet& sheet, const BarChart& chart, Vec2 corner, double width);

// `names`: of all line charts of the figure; a line's colour is that of its name's place in it.
void DrawLineChart(Sheet& sheet, const LineChart& chart, const Area& area,
                   const std::vector<std::string>& names);
void DrawLineLegend(Sheet& sheet, const std::vector<std::string>& names, Vec2 corner, double width);

}  // namespace pliant::plot
