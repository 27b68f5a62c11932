// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/report_plot.h"

#include "descriptor/plot/plot.h"

namespace pliant::evaluation {
namespace {

plot::BarChart Bars(const MatchingReport& report) {
  plot::BarChart chart;
  chart.measures = {"MS", "MMA", "mutual precision"};
  for (const DescriptorResult& r : report.results)
    chart.groups.push_back({r.label, {{r.ms, r.ms_error}, {r.mma}, {r.mutual_precision}}});
  return chart;
}

plot::LineChart Curves(const MatchingReport& report) {
  plot::LineChart chart;
  chart.logarithmic = report.sweep == "scale";
  chart.x_label =
      chart.logarithmic ? "scale of the object" : "rotation in the picture plane, degrees";
  chart.y_label = "MS";
  for (const DescriptorResult& r : report.results) chart.lines.push_back({r.label, {}, {}});
  for (const Subset& point : report.curve) {
    chart.x_ticks.push_back(point.value);
    for (std::size_t row = 0; row < report.results.size(); ++row)
      chart.lines[row].points.push_back({point.value, point.results[row].ms});
  }
  return chart;
}

}  // namespace

Image PlotMatchingReport(const MatchingReport& report, const std::string& title) {
  plot::Figure figure;
  figure.title = title;
  figure.subtitle = std::to_string(report.pairs) +
                    " pairs; bars: means over pairs; whiskers: standard error of the mean";
  figure.bar_charts = {Bars(report)};
  if (report.curve.size() > 1) figure.line_charts = {Curves(report)};
  return plot::DrawFigure(figure);
}

}  // namespace pliant::evaluation
