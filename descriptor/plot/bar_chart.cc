// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "descriptor/plot/axis.h"
#include "descriptor/plot/chart.h"

namespace pliant::plot {
namespace {

constexpr int kBarHeight = 14;
constexpr int kGroupGap = 14;
constexpr int kAxisHeight = 30;
constexpr int kValueWidth = 40;  // of the number behind a bar
constexpr int kMostTicks = 8;
constexpr double kNameShare = 0.4;  // of the chart's width, at most, for the groups' names

// Quieter than the colours of lines, so that a measure is not taken for a line of that colour.
Colour MeasureColour(std::size_t measure) {
  static constexpr std::array kColours = {Colour{46, 66, 102}, Colour{124, 156, 190},
                                          Colour{214, 176, 104}, Colour{150, 105, 100}};
  return kColours[measure % kColours.size()];
}

double GroupHeight(const BarChart& chart) {
  return kBarHeight * static_cast<double>(chart.measures.size()) + kGroupGap;
}

double NamesWidth(const BarChart& chart, const Area& area) {
  double widest = 0;
  for (const BarChart::Group& group : chart.groups)
    widest = std::max(widest, Sheet::TextWidth(group.name, kLetters));
  return std::min(widest, kNameShare * (area.right - area.left));
}

double Longest(const BarChart& chart) {
  double longest = 0;
  for (const BarChart::Group& group : chart.groups) {
    for (const Bar& bar : group.bars) longest = std::max(longest, bar.value + bar.error);
  }
  return longest > 0 ? longest : 1;
}

Axis ValueAxis(const BarChart& chart, const Area& area) {
  const double longest = Longest(chart);
  const double step = NiceStep(longest, kMostTicks);
  return {0, step * std::ceil(longest / step - 1e-9), area.left + NamesWidth(chart, area) + 12,
          area.right - kValueWidth};
}

void DrawBar(Sheet& sheet, const Bar& bar, const Axis& axis, double top, Colour colour) {
  const double end = axis(bar.value);
  sheet.Box({axis(0), top + 1}, {end, top + kBarHeight - 1}, colour);
  double free_from = end;
  if (bar.error > 0) {
    const double middle = top + 0.5 * kBarHeight;
    free_from = axis(bar.value + bar.error);
    sheet.Line({axis(bar.value - bar.error), middle}, {free_from, middle}, kInk);
    for (const double sign : {-1.0, 1.0}) {
      const double x = axis(bar.value + sign * bar.error);
      sheet.Line({x, middle - 3}, {x, middle + 3}, kInk);
    }
  }
  sheet.Text(NumberText(bar.value, 3), {free_from + 6, top + kBarHeight - 3}, kSmallLetters);
}

}  // namespace

double BarChartHeight(const BarChart& chart) {
  return (chart.title.empty() ? 8 : kChartTitleHeight) +
         GroupHeight(chart) * static_cast<double>(chart.groups.size()) + kAxisHeight;
}

void DrawBarChart(Sheet& sheet, const BarChart& chart, const Area& area) {
  const Axis axis = ValueAxis(chart, area);
  double top = area.top + 8;
  if (!chart.title.empty()) {
    top = area.top + kChartTitleHeight;
    sheet.Text(Sheet::Shortened(chart.title, area.right - area.left, kHeading),
               {area.left, top - 10}, kHeading);
  }
  const double bottom = top + GroupHeight(chart) * static_cast<double>(chart.groups.size());
  const std::vector<double> ticks = NiceTicks(0, axis.high(), kMostTicks);
  const std::vector<std::string> texts = TickTexts(ticks);
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    const double x = axis(ticks[i]);
    sheet.Line({x, top - 4}, {x, bottom - 4}, i == 0 ? colours::kGrey : kFaint);
    sheet.Text(texts[i], {x, bottom + 14}, kLetters, colours::kGrey, Align::kCentre);
  }
  const double names_width = NamesWidth(chart, area);
  const double half_group = 0.5 * (GroupHeight(chart) - kGroupGap);
  for (const BarChart::Group& group : chart.groups) {
    sheet.Text(Sheet::Shortened(group.name, names_width, kLetters),
               {area.left + names_width, top + half_group + 0.45 * kLetters}, kLetters, kInk,
               Align::kRight);
    for (std::size_t i = 0; i < group.bars.size(); ++i) {
      DrawBar(sheet, group.bars[i], axis, top + static_cast<double>(i) * kBarHeight,
              MeasureColour(i));
    }
    top += GroupHeight(chart);
  }
}

void DrawBarLegend(Sheet& sheet, const BarChart& chart, Vec2 corner, double width) {
  double baseline = corner.y + kLegendRow;
  for (std::size_t i = 0; i < chart.measures.size(); ++i) {
    sheet.Box({corner.x + 12, baseline - 11}, {corner.x + 24, baseline + 1}, MeasureColour(i));
    sheet.Text(Sheet::Shortened(chart.measures[i], width - kLegendSymbol, kLetters),
               {corner.x + kLegendSymbol, baseline}, kLetters);
    baseline += kLegendRow;
  }
}

}  // namespace pliant::plot
