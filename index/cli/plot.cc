// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/plot.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "descriptor/drawing.h"
#include "descriptor/error.h"
#include "index/cli/output.h"

namespace pliant::cli {
namespace {

// Everything is drawn this many times larger and then scaled down, which smooths the letters.
constexpr int kOversampling = 2;
constexpr int kWidth = 620;  // of a chart
constexpr int kHeight = 520;
constexpr int kLeft = 62;
constexpr int kRight = 20;
constexpr int kTop = 66;
constexpr int kBottom = 56;
constexpr int kLetters = 11;
constexpr int kTicks = 20;  // on the x axis, at most
constexpr Colour kInk{40, 40, 40};
constexpr Colour kPale{224, 224, 224};

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
};

Range RangeOf(const Plot& plot) {
  Range range;
  for (const PlotSeries& series : plot.series) {
    for (const Vec2 p : series.points) {
      if (!std::isfinite(p.x) || !std::isfinite(p.y)) {
        throw Error(ErrorCode::kInvalidArgument, "plot_invalid",
                    "the curve " + series.name + " has a point that is not finite");
      }
      range.low = std::min(range.low, p.x);
      range.high = std::max(range.high, p.x);
    }
  }
  if (range.low > range.high) {
    throw Error(ErrorCode::kInvalidArgument, "plot_invalid", "there is nothing to draw");
  }
  return range;
}

// One chart on the sheet; coordinates are those of the chart before oversampling.
class Chart {
 public:
  Chart(Image& sheet, int left, const Plot& plot, const std::vector<std::string>& names)
      : sheet_(sheet), left_(left), plot_(plot), names_(names), range_(RangeOf(plot)) {}

  void Draw() {
    Text(kLeft, 26, plot_.title, kInk, 15);
    Text(kLeft - 44, kTop - 14, plot_.y_label, kInk, kLetters);
    const int label = TextWidth(plot_.x_label, kLetters);
    Text((kLeft + kWidth - kRight - label) / 2, kHeight - 14, plot_.x_label, kInk, kLetters);
    DrawAxes();
    for (const PlotSeries& series : plot_.series) DrawSeries(series);
    DrawLegend();
  }

 private:
  Vec2 Place(Vec2 value) const {
    const double span = std::max(range_.high - range_.low, 1e-9);
    return {kLeft + (kWidth - kLeft - kRight) * (value.x - range_.low) / span,
            kTop + (kHeight - kTop - kBottom) * (1 - std::clamp(value.y, 0.0, 1.0))};
  }
  Vec2 OnSheet(Vec2 p) const { return {kOversampling * (left_ + p.x), kOversampling * p.y}; }
  Colour ColourOf(const std::string& name) const {
    const auto found = std::find(names_.begin(), names_.end(), name);
    return DistinctColour(static_cast<std::size_t>(found - names_.begin()));
  }
  void Line(Vec2 a, Vec2 b, Colour colour, int thickness) {
    pliant::DrawLine(sheet_, OnSheet(a), OnSheet(b), colour, thickness);
  }
  void Text(double x, double y, const std::string& text, Colour colour, int height) {
    DrawText(sheet_, static_cast<int>(kOversampling * (left_ + x)),
             static_cast<int>(kOversampling * y), text, colour, kOversampling * height);
  }

  void DrawAxes() {
    for (int tenth = 0; tenth <= 10; ++tenth) {
      const double y = Place({range_.low, tenth / 10.0}).y;
      Line({kLeft, y}, {kWidth - kRight, y}, tenth == 0 ? kInk : kPale, kOversampling);
      if (tenth % 2 == 0) Text(kLeft - 30, y + 4, FormatFixed(tenth / 10.0, 1), kInk, kLetters);
    }
    const auto step =
        static_cast<int>(std::max(1.0, std::ceil((range_.high - range_.low) / kTicks)));
    for (int x = static_cast<int>(std::ceil(range_.low)); x <= range_.high; x += step) {
      const double at = Place({static_cast<double>(x), 0}).x;
      Line({at, kHeight - kBottom}, {at, kHeight - kBottom + 5}, kInk, kOversampling);
      const std::string text = std::to_string(x);
      Text(at - 0.5 * TextWidth(text, kLetters), kHeight - kBottom + 20, text, kInk, kLetters);
    }
  }

  void DrawSeries(const PlotSeries& series) {
    const Colour colour = ColourOf(series.name);
    std::vector<Vec2> line;
    for (std::size_t i = 0; i < series.points.size(); ++i) {
      const Vec2 p = series.points[i];
      line.push_back(OnSheet(Place(p)));
      DrawDot(sheet_, line.back(), 3 * kOversampling, colour);
      if (series.spreads.empty() || series.spreads[i] <= 0) continue;
      Line(Place({p.x, p.y - series.spreads[i]}), Place({p.x, p.y + series.spreads[i]}), colour,
           kOversampling);
    }
    DrawPolyline(sheet_, line, false, colour, 2 * kOversampling);
  }

  // Where curves that fall with x leave room: the upper right corner.
  void DrawLegend() {
    int widest = 0;
    for (const PlotSeries& series : plot_.series) {
      widest = std::max(widest, TextWidth(series.name, kLetters));
    }
    const int x = kWidth - kRight - widest - 42;
    const auto rows = static_cast<int>(plot_.series.size());
    FillBox(sheet_, kOversampling * (left_ + x - 8), kOversampling * (kTop + 4),
            kOversampling * (widest + 46), kOversampling * (18 * rows + 8), colours::kWhite);
    for (int row = 0; row < rows; ++row) {
      const std::string& name = plot_.series[static_cast<std::size_t>(row)].name;
      const double y = kTop + 18.0 * row + 16;
      Line({x + 0.0, y}, {x + 24.0, y}, ColourOf(name), 2 * kOversampling);
      Text(x + 32, y + 4, name, kInk, kLetters);
    }
  }

  Image& sheet_;
  int left_;
  const Plot& plot_;
  const std::vector<std::string>& names_;
  Range range_;
};

}  // namespace

Image DrawPlots(const std::vector<Plot>& plots) {
  if (plots.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "plot_invalid", "there is nothing to draw");
  }
  std::vector<std::string> names;  // colours go by the order of first appearance
  for (const Plot& plot : plots) {
    for (const PlotSeries& series : plot.series) {
      if (std::find(names.begin(), names.end(), series.name) == names.end())
        names.push_back(series.name);
    }
  }
  const int width = kWidth * static_cast<int>(plots.size());
  Image sheet = BlankPicture(kOversampling * width, kOversampling * kHeight, colours::kWhite);
  for (std::size_t i = 0; i < plots.size(); ++i) {
    Chart(sheet, static_cast<int>(i) * kWidth, plots[i], names).Draw();
  }
  return ResizeImage(sheet, width, kHeight);
}

}  // namespace pliant::cli
