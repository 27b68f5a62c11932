// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/report_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "descriptor/evaluation/sheet.h"

namespace pliant::evaluation {
namespace {

constexpr int kWidth = 980;
constexpr int kMargin = 24;
constexpr int kTitleHeight = 78;
constexpr int kBarHeight = 13;
constexpr int kRowGap = 14;
constexpr int kAxisHeight = 44;
constexpr int kCurveHeight = 430;
constexpr int kLetters = 11;
constexpr int kSmallLetters = 9;

struct Figure {
  const char* name;
  double DescriptorResult::*value;
  Colour colour;
};
constexpr std::array<Figure, 3> kFigures = {
    {{"MS", &DescriptorResult::ms, {31, 119, 180}},
     {"MMA", &DescriptorResult::mma, {244, 150, 60}},
     {"mutual precision", &DescriptorResult::mutual_precision, {44, 140, 60}}}};

constexpr int kRowHeight = static_cast<int>(kFigures.size()) * kBarHeight + kRowGap;

std::string Number(double value, int decimals) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

double LabelWidth(const MatchingReport& report) {
  double widest = 0;
  for (const DescriptorResult& r : report.results)
    widest = std::max(widest, Sheet::TextWidth(r.label, kLetters));
  return widest;
}

void DrawTitle(Sheet& sheet, const MatchingReport& report, const std::string& title) {
  sheet.Text(title, {kMargin, 32}, 15);
  sheet.Text(std::to_string(report.pairs) + " pairs; bars: means over pairs", {kMargin, 60},
             kLetters, colours::kGrey);
  double x = kWidth - kMargin;
  for (auto figure = kFigures.rbegin(); figure != kFigures.rend(); ++figure) {
    x -= Sheet::TextWidth(figure->name, kLetters);
    sheet.Text(figure->name, {x, 60}, kLetters);
    sheet.Box({x - 20, 49}, {x - 7, 61}, figure->colour);
    x -= 44;
  }
}

// Horizontal bars from 0 to 1, a group a descriptor.
void DrawBars(Sheet& sheet, const MatchingReport& report, double top) {
  const double left = kMargin + LabelWidth(report) + 12;
  const double width = kWidth - kMargin - 50 - left;
  const double bottom = top + static_cast<double>(report.results.size()) * kRowHeight;
  for (int tenth = 0; tenth <= 10; tenth += 2) {
    const double x = left + width * tenth / 10;
    sheet.Line({x, top - 4}, {x, bottom}, kFaint);
    sheet.Text(Number(tenth / 10.0, 1), {x, bottom + 18}, kLetters, colours::kGrey, Align::kCentre);
  }
  double y = top;
  for (const DescriptorResult& r : report.results) {
    sheet.Text(r.label, {left - 12, y + 1.5 * kBarHeight + kLetters / 2}, kLetters, kInk,
               Align::kRight);
    for (const Figure& figure : kFigures) {
      const double value = r.*figure.value;
      sheet.Box({left, y + 1}, {left + width * value, y + kBarHeight - 1}, figure.colour);
      sheet.Text(Number(value, 3), {left + width * value + 6, y + kBarHeight - 3}, kSmallLetters);
      y += kBarHeight;
    }
    y += kRowGap;
  }
}

// The curves' frame and what its axes mean.
struct Frame {
  double left, top, right, bottom;
  double low, high;  // of the sweep
  double top_value;  // of MS at the top
  bool logarithmic;

  double X(double value) const {
    const auto place = [this](double v) { return logarithmic ? std::log(v) : v; };
    const double span = place(high) - place(low);
    return span > 0 ? left + (right - left) * (place(value) - place(low)) / span : left;
  }
  double Y(double value) const { return bottom - (bottom - top) * value / top_value; }
};

Frame CurveFrame(const MatchingReport& report, double top) {
  double highest = 0.1;
  for (const Subset& point : report.curve) {
    for (const DescriptorResult& r : point.results) highest = std::max(highest, r.ms);
  }
  return {kMargin + 52.0,
          top + 34,
          kWidth - kMargin - LabelWidth(report) - 90,
          top + kCurveHeight - kAxisHeight,
          report.curve.front().value,
          report.curve.back().value,
          std::ceil(highest * 10 + 0.2) / 10,
          report.sweep == "scale"};
}

void DrawAxes(Sheet& sheet, const MatchingReport& report, const Frame& frame) {
  const int steps = static_cast<int>(std::lround(frame.top_value * 10));
  for (int i = 0; i <= steps; ++i) {
    const double y = frame.Y(i / 10.0);
    sheet.Line({frame.left, y}, {frame.right, y}, i == 0 ? colours::kGrey : kFaint);
    sheet.Text(Number(i / 10.0, 1), {frame.left - 10, y + 4}, kLetters, colours::kGrey,
               Align::kRight);
  }
  double free_from = -1e9;  // labels must not run into each other
  for (const Subset& point : report.curve) {
    const double x = frame.X(point.value);
    sheet.Line({x, frame.bottom}, {x, frame.bottom + 5}, colours::kGrey);
    const std::string text = Number(point.value, frame.logarithmic ? 2 : 0);
    const double half = 0.5 * Sheet::TextWidth(text, kLetters);
    if (x - half < free_from) continue;
    sheet.Text(text, {x, frame.bottom + 20}, kLetters, colours::kGrey, Align::kCentre);
    free_from = x + half + 8;
  }
  const std::string what =
      frame.logarithmic ? "scale of the object" : "rotation in the picture plane, degrees";
  sheet.Text(what, {0.5 * (frame.left + frame.right), frame.bottom + 40}, kLetters, kInk,
             Align::kCentre);
  sheet.Text("MS", {frame.left - 40, frame.top - 14}, kLetters);
}

void DrawCurves(Sheet& sheet, const MatchingReport& report, double top) {
  const Frame frame = CurveFrame(report, top);
  DrawAxes(sheet, report, frame);
  double legend = frame.top + 6;
  for (std::size_t row = 0; row < report.results.size(); ++row) {
    const Colour colour = DistinctColour(row);
    Vec2 before;
    for (std::size_t i = 0; i < report.curve.size(); ++i) {
      const Vec2 here{frame.X(report.curve[i].value), frame.Y(report.curve[i].results[row].ms)};
      if (i > 0) sheet.Line(before, here, colour, 1.7);
      sheet.Disc(here, 2.8, colour);
      before = here;
    }
    const double x = frame.right + 20;
    sheet.Line({x, legend - 4}, {x + 24, legend - 4}, colour, 1.7);
    sheet.Disc({x + 12, legend - 4}, 2.8, colour);
    sheet.Text(report.results[row].label, {x + 32, legend}, kLetters);
    legend += 20;
  }
}

}  // namespace

Image PlotMatchingReport(const MatchingReport& report, const std::string& title) {
  const int bars = static_cast<int>(report.results.size()) * kRowHeight + kAxisHeight;
  const int curves = report.curve.size() > 1 ? kCurveHeight + kMargin : 0;
  Sheet sheet(kWidth, kTitleHeight + bars + curves);
  DrawTitle(sheet, report, title);
  DrawBars(sheet, report, kTitleHeight);
  if (curves > 0) DrawCurves(sheet, report, kTitleHeight + bars);
  return sheet.Finish();
}

}  // namespace pliant::evaluation
