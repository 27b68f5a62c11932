// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Checks a figure and divides the sheet among its charts.
#include <algorithm>
#include <cmath>

#include "descriptor/base/error.h"
#include "descriptor/plot/chart.h"

namespace pliant::plot {
namespace {

constexpr int kWidth = 920;
constexpr int kMargin = 20;
constexpr int kGap = 22;  // between charts, and to the legend
constexpr int kSingleHeight = 400;
constexpr int kPairHeight = 330;
constexpr double kWidestLegend = 220;

[[noreturn]] void Refuse(const std::string& why) {
  throw Error(ErrorCode::kInvalidArgument, "plot_invalid", why);
}

void CheckBars(const BarChart& chart) {
  if (chart.groups.empty() || chart.measures.empty()) Refuse("there are no bars to draw");
  for (const BarChart::Group& group : chart.groups) {
    if (group.bars.size() != chart.measures.size()) {
      Refuse("the group " + group.name + " has " + std::to_string(group.bars.size()) +
             " bars for " + std::to_string(chart.measures.size()) + " measures");
    }
    for (const Bar& bar : group.bars) {
      if (!std::isfinite(bar.value) || bar.value < 0 || !std::isfinite(bar.error) || bar.error < 0)
        Refuse("the group " + group.name + " has a bar that is not a finite number from 0");
    }
  }
}

void CheckLines(const LineChart& chart) {
  bool points = false;
  for (const Line& line : chart.lines) {
    if (!line.spreads.empty() && line.spreads.size() != line.points.size())
      Refuse("the curve " + line.name + " has not as many spreads as points");
    for (const Vec2 p : line.points) {
      if (!std::isfinite(p.x) || !std::isfinite(p.y))
        Refuse("the curve " + line.name + " has a point that is not finite");
      if (chart.logarithmic && p.x <= 0)
        Refuse("the curve " + line.name + " has a point that a logarithmic axis cannot show");
      points = true;
    }
    for (const double spread : line.spreads) {
      if (!std::isfinite(spread)) Refuse("the curve " + line.name + " has an infinite spread");
    }
  }
  if (!points) Refuse("the chart " + chart.title + " has no points to draw");
}

// In the order of their first appearance.
std::vector<std::string> LineNames(const Figure& figure) {
  std::vector<std::string> names;
  for (const LineChart& chart : figure.line_charts) {
    for (const Line& line : chart.lines) {
      if (std::find(names.begin(), names.end(), line.name) == names.end())
        names.push_back(line.name);
    }
  }
  return names;
}

double LegendWidth(const Figure& figure, const std::vector<std::string>& line_names) {
  double widest = 0;
  const auto add = [&widest](const std::string& name) {
    widest = std::max(widest, Sheet::TextWidth(name, kLetters));
  };
  for (const std::string& name : line_names) add(name);
  for (const BarChart& chart : figure.bar_charts) {
    for (const std::string& name : chart.measures) add(name);
  }
  return std::min(kWidestLegend, std::ceil(widest) + kLegendSymbol + 2);
}

// Where everything stands; drawn only when there is a sheet, for the height comes out at the end.
class Layout {
 public:
  explicit Layout(const Figure& figure)
      : figure_(figure),
        names_(LineNames(figure)),
        legend_width_(LegendWidth(figure, names_)),
        legend_x_(kWidth - kMargin - legend_width_),
        right_(legend_x_ - kGap) {}

  // The lower end of the figure.
  double Draw(Sheet* sheet) const {
    double y = DrawHeader(sheet);
    for (const BarChart& chart : figure_.bar_charts) y = DrawBars(sheet, chart, y) + kGap;
    return DrawLines(sheet, y);
  }

 private:
  double DrawHeader(Sheet* sheet) const {
    const int width = kWidth - 2 * kMargin;
    if (sheet != nullptr) {
      sheet->Text(Sheet::Shortened(figure_.title, width, 15), {kMargin, 32}, 15);
      sheet->Text(Sheet::Shortened(figure_.subtitle, width, kLetters), {kMargin, 56}, kLetters,
                  colours::kGrey);
    }
    return figure_.subtitle.empty() ? 50 : 74;
  }

  double DrawBars(Sheet* sheet, const BarChart& chart, double top) const {
    const Area area{kMargin, top, right_, top + BarChartHeight(chart)};
    if (sheet != nullptr) {
      DrawBarChart(*sheet, chart, area);
      DrawBarLegend(*sheet, chart, {legend_x_, top}, legend_width_);
    }
    return std::max(area.bottom, top + kLegendRow * (1.0 + chart.measures.size()));
  }

  double DrawLines(Sheet* sheet, double top) const {
    const std::vector<LineChart>& charts = figure_.line_charts;
    if (charts.empty()) return top;
    if (sheet != nullptr) DrawLineLegend(*sheet, names_, {legend_x_, top}, legend_width_);
    const double legend_bottom = top + kLegendRow * (1.0 + names_.size());
    const std::size_t columns = charts.size() == 1 ? 1 : 2;
    const double height = columns == 1 ? kSingleHeight : kPairHeight;
    const double width = (right_ - kMargin - kGap * (columns - 1.0)) / columns;
    for (std::size_t i = 0; i < charts.size(); ++i) {
      const double left = kMargin + static_cast<double>(i % columns) * (width + kGap);
      if (sheet != nullptr) {
        DrawLineChart(*sheet, charts[i], {left, top, left + width, top + height}, names_);
      }
      if (i % columns == columns - 1 || i + 1 == charts.size()) top += height + kGap;
    }
    return std::max(top, legend_bottom);
  }

  const Figure& figure_;
  std::vector<std::string> names_;
  double legend_width_;
  double legend_x_;
  double right_;  // of the charts
};

}  // namespace

Image DrawFigure(const Figure& figure) {
  if (figure.bar_charts.empty() && figure.line_charts.empty()) Refuse("there is nothing to draw");
  for (const BarChart& chart : figure.bar_charts) CheckBars(chart);
  for (const LineChart& chart : figure.line_charts) CheckLines(chart);
  const Layout layout(figure);
  Sheet sheet(kWidth, static_cast<int>(std::ceil(layout.Draw(nullptr))));
  layout.Draw(&sheet);
  return sheet.Finish();
}

}  // namespace pliant::plot
