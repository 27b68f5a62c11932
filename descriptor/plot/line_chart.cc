// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include "descriptor/plot/axis.h"
#include "descriptor/plot/chart.h"

namespace pliant::plot {
namespace {

constexpr int kYNumbers = 46;    // left of the axis
constexpr int kYLabel = 26;      // above it
constexpr int kXAxis = 48;       // below it: numbers and label
constexpr int kLastNumber = 16;  // half the last number of the x axis reaches beyond its end
constexpr int kMostYTicks = 6;
constexpr int kTickSpace = 44;   // pixels a number of the x axis takes
constexpr int kMarkerSpace = 9;  // pixels between markers, at least
constexpr double kMarker = 3.2;  // radius
constexpr double kStroke = 1.7;

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void Add(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
};

struct Axes {
  Axis x, y;
  std::vector<double> y_ticks;
};

double SpreadAt(const Line& line, std::size_t i) {
  return line.spreads.empty() ? 0 : line.spreads[i];
}

// y from 0, or from below where there are values below; up to y_top, or a round number.
Axes MakeAxes(const LineChart& chart, const Area& plot) {
  Range x;
  Range y;
  y.Add(0);
  for (const Line& line : chart.lines) {
    for (std::size_t i = 0; i < line.points.size(); ++i) {
      x.Add(line.points[i].x);
      y.Add(line.points[i].y + SpreadAt(line, i));
      y.Add(std::min(line.points[i].y, 0.0));
    }
  }
  if (chart.y_top > 0) y.high = chart.y_top;
  if (!(y.high > y.low)) y.high = y.low + 1;
  const double step = NiceStep(y.high - y.low, kMostYTicks);
  const double low = step * std::floor(y.low / step + 1e-9);
  const double high = chart.y_top > 0 ? y.high : step * std::ceil(y.high / step - 1e-9);
  return {Axis(x.low, x.high, plot.left, plot.right, chart.logarithmic),
          Axis(low, high, plot.bottom, plot.top), NiceTicks(low, high, kMostYTicks)};
}

void DrawYAxis(Sheet& sheet, const Axes& axes, const Area& plot) {
  const std::vector<std::string> texts = TickTexts(axes.y_ticks);
  for (std::size_t i = 0; i < texts.size(); ++i) {
    const double y = axes.y(axes.y_ticks[i]);
    sheet.Line({plot.left, y}, {plot.right, y}, i == 0 ? colours::kGrey : kFaint);
    sheet.Text(texts[i], {plot.left - 9, y + 4}, kLetters, colours::kGrey, Align::kRight);
  }
}

std::vector<double> XTicks(const LineChart& chart, const Axis& x, double width) {
  if (!chart.x_ticks.empty()) return chart.x_ticks;
  const int most = std::max(1, static_cast<int>(width / kTickSpace));
  if (!chart.logarithmic) return NiceTicks(x.low(), x.high(), most);
  std::vector<double> ticks;
  const auto last = static_cast<int>(std::floor(std::log10(x.high())));
  for (auto power = static_cast<int>(std::floor(std::log10(x.low()))); power <= last; ++power) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double tick = factor * std::pow(10.0, power);
      if (tick >= x.low() * (1 - 1e-9) && tick <= x.high() * (1 + 1e-9)) ticks.push_back(tick);
    }
  }
  return ticks;
}

void DrawXAxis(Sheet& sheet, const LineChart& chart, const Axis& axis, const Area& plot) {
  const std::vector<double> ticks = XTicks(chart, axis, plot.right - plot.left);
  const std::vector<std::string> texts = TickTexts(ticks);
  double free_from = -std::numeric_limits<double>::infinity();  // numbers must not touch
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    const double x = axis(ticks[i]);
    sheet.Line({x, plot.bottom}, {x, plot.bottom + 5}, colours::kGrey);
    const double half = 0.5 * Sheet::TextWidth(texts[i], kLetters);
    if (x - half < free_from) continue;
    sheet.Text(texts[i], {x, plot.bottom + 20}, kLetters, colours::kGrey, Align::kCentre);
    free_from = x + half + 8;
  }
}

void DrawLine(Sheet& sheet, const Line& line, std::size_t number, const Axes& axes) {
  const Colour colour = DistinctColour(number);
  const auto count = static_cast<double>(line.points.size());
  const double spacing = std::abs(axes.x(axes.x.high()) - axes.x(axes.x.low())) / count;
  // Where all points are above each other, the first and the last have a marker.
  const auto every = static_cast<std::size_t>(
      std::clamp(std::ceil(kMarkerSpace / spacing), 1.0, std::max(1.0, count)));
  Vec2 before;
  for (std::size_t i = 0; i < line.points.size(); ++i) {
    const Vec2 point = line.points[i];
    const Vec2 here{axes.x(point.x), axes.y(point.y)};
    if (i > 0) sheet.Line(before, here, colour, kStroke);
    if (i % every == 0 || i + 1 == line.points.size()) sheet.Marker(number, here, kMarker, colour);
    if (const double spread = SpreadAt(line, i); spread > 0) {
      sheet.Line({here.x, axes.y(point.y - spread)}, {here.x, axes.y(point.y + spread)}, colour);
    }
    before = here;
  }
}

}  // namespace

void DrawLineChart(Sheet& sheet, const LineChart& chart, const Area& area,
                   const std::vector<std::string>& names) {
  const double width = area.right - area.left;
  double top = area.top;
  if (!chart.title.empty()) {
    sheet.Text(Sheet::Shortened(chart.title, width, kHeading), {area.left, top + 15}, kHeading);
    top += kChartTitleHeight;
  }
  const Area plot{area.left + kYNumbers, top + kYLabel, area.right - kLastNumber,
                  area.bottom - kXAxis};
  sheet.Text(Sheet::Shortened(chart.y_label, width, kLetters), {area.left, plot.top - 13},
             kLetters);
  sheet.Text(Sheet::Shortened(chart.x_label, width, kLetters),
             {0.5 * (plot.left + plot.right), plot.bottom + 40}, kLetters, kInk, Align::kCentre);
  const Axes axes = MakeAxes(chart, plot);
  DrawYAxis(sheet, axes, plot);
  DrawXAxis(sheet, chart, axes.x, plot);
  for (const Line& line : chart.lines) {
    const auto name = std::find(names.begin(), names.end(), line.name);
    DrawLine(sheet, line, static_cast<std::size_t>(name - names.begin()), axes);
  }
}

void DrawLineLegend(Sheet& sheet, const std::vector<std::string>& names, Vec2 corner,
                    double width) {
  double y = corner.y + kLegendRow - 4;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Colour colour = DistinctColour(i);
    sheet.Line({corner.x, y}, {corner.x + 24, y}, colour, kStroke);
    sheet.Marker(i, {corner.x + 12, y}, kMarker, colour);
    sheet.Text(Sheet::Shortened(names[i], width - kLegendSymbol, kLetters),
               {corner.x + kLegendSymbol, y + 4}, kLetters);
    y += kLegendRow;
  }
}

}  // namespace pliant::plot
