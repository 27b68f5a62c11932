// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/report_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "descriptor/evaluation/canvas.h"

namespace pliant::evaluation {
namespace {

constexpr int kWidth = 980;
constexpr int kMargin = 24;
constexpr int kTitleHeight = 78;
constexpr int kBarHeight = 13;
constexpr int kRowGap = 14;
constexpr int kAxisHeight = 44;
constexpr int kCurveHeight = 430;
constexpr double kLetters = 11;

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
    widest = std::max(widest, Canvas::TextWidth(r.label, kLetters));
  return widest;
}

void DrawTitle(Canvas& canvas, const MatchingReport& report, const std::string& title) {
  canvas.Text(title, {kMargin, 32}, 15);
  canvas.Text(std::to_string(report.pairs) + " pairs; bars: means over pairs", {kMargin, 60},
              kLetters, kGrey);
  double x = kWidth - kMargin;
  for (auto figure = kFigures.rbegin(); figure != kFigures.rend(); ++figure) {
    x -= Canvas::TextWidth(figure->name, kLetters);
    canvas.Text(figure->name, {x, 60}, kLetters);
    canvas.Box({x - 20, 49}, {x - 7, 61}, figure->colour);
    x -= 44;
  }
}

// Horizontal bars from 0 to 1, a group a descriptor.
void DrawBars(Canvas& canvas, const MatchingReport& report, double top) {
  const double left = kMargin + LabelWidth(report) + 12;
  const double width = kWidth - kMargin - 50 - left;
  const double bottom = top + static_cast<double>(report.results.size()) * kRowHeight;
  for (int tenth = 0; tenth <= 10; tenth += 2) {
    const double x = left + width * tenth / 10;
    canvas.Line({x, top - 4}, {x, bottom}, kPale);
    canvas.Text(Number(tenth / 10.0, 1), {x, bottom + 18}, kLetters, kGrey, Align::kCentre);
  }
  double y = top;
  for (const DescriptorResult& r : report.results) {
    canvas.Text(r.label, {left - 12, y + 1.5 * kBarHeight + kLetters / 2}, kLetters, kBlack,
                Align::kRight);
    for (const Figure& figure : kFigures) {
      const double value = r.*figure.value;
      canvas.Box({left, y + 1}, {left + width * value, y + kBarHeight - 1}, figure.colour);
      canvas.Text(Number(value, 3), {left + width * value + 6, y + kBarHeight - 3}, 8.5);
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

void DrawAxes(Canvas& canvas, const MatchingReport& report, const Frame& frame) {
  const int steps = static_cast<int>(std::lround(frame.top_value * 10));
  for (int i = 0; i <= steps; ++i) {
    const double y = frame.Y(i / 10.0);
    canvas.Line({frame.left, y}, {frame.right, y}, i == 0 ? kGrey : kPale);
    canvas.Text(Number(i / 10.0, 1), {frame.left - 10, y + 4}, kLetters, kGrey, Align::kRight);
  }
  double free_from = -1e9;  // labels must not run into each other
  for (const Subset& point : report.curve) {
    const double x = frame.X(point.value);
    canvas.Line({x, frame.bottom}, {x, frame.bottom + 5}, kGrey);
    const std::string text = Number(point.value, frame.logarithmic ? 2 : 0);
    const double half = 0.5 * Canvas::TextWidth(text, kLetters);
    if (x - half < free_from) continue;
    canvas.Text(text, {x, frame.bottom + 20}, kLetters, kGrey, Align::kCentre);
    free_from = x + half + 8;
  }
  const std::string what =
      frame.logarithmic ? "scale of the object" : "rotation in the picture plane, degrees";
  canvas.Text(what, {0.5 * (frame.left + frame.right), frame.bottom + 40}, kLetters, kBlack,
              Align::kCentre);
  canvas.Text("MS", {frame.left - 40, frame.top - 14}, kLetters);
}

void DrawCurves(Canvas& canvas, const MatchingReport& report, double top) {
  const Frame frame = CurveFrame(report, top);
  DrawAxes(canvas, report, frame);
  double legend = frame.top + 6;
  for (std::size_t row = 0; row < report.results.size(); ++row) {
    const Colour colour = SeriesColour(row);
    Vec2 before;
    for (std::size_t i = 0; i < report.curve.size(); ++i) {
      const Vec2 here{frame.X(report.curve[i].value), frame.Y(report.curve[i].results[row].ms)};
      if (i > 0) canvas.Line(before, here, colour, 1.7);
      canvas.Disc(here, 2.8, colour);
      before = here;
    }
    const double x = frame.right + 20;
    canvas.Line({x, legend - 4}, {x + 24, legend - 4}, colour, 1.7);
    canvas.Disc({x + 12, legend - 4}, 2.8, colour);
    canvas.Text(report.results[row].label, {x + 32, legend}, kLetters);
    legend += 20;
  }
}

}  // namespace

Image PlotMatchingReport(const MatchingReport& report, const std::string& title) {
  const int bars = static_cast<int>(report.results.size()) * kRowHeight + kAxisHeight;
  const int curves = report.curve.size() > 1 ? kCurveHeight + kMargin : 0;
  Canvas canvas(kWidth, kTitleHeight + bars + curves);
  DrawTitle(canvas, report, title);
  DrawBars(canvas, report, kTitleHeight);
  if (curves > 0) DrawCurves(canvas, report, kTitleHeight + bars);
  return canvas.ToImage();
}

}  // namespace pliant::evaluation
