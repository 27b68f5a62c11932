// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Bar charts and curves for reports: all plots of the project are drawn here. Text is
// ASCII; text that is too long is cut and ends in "...".
#pragma once

#include <string>
#include <vector>

#include "descriptor/image/image.h"
#include "descriptor/warp/tps.h"

namespace pliant::plot {

struct Bar {
  double value = 0;  // not negative
  double error = 0;  // half the length of the whisker at the bar's end; 0 = none
};

// Horizontal bars from 0, in groups.
struct BarChart {
  struct Group {
    std::string name;
    std::vector<Bar> bars;  // one per measure
  };
  std::string title;                  // may be empty
  std::vector<std::string> measures;  // meaning of the bars in every group, from the top
  std::vector<Group> groups;          // from the top
};

struct Line {
  std::string name;
  std::vector<Vec2> points;     // x ascending
  std::vector<double> spreads;  // half the length of a whisker at each point; empty = none
};

struct LineChart {
  std::string title;  // may be empty
  std::string x_label;
  std::string y_label;
  std::vector<Line> lines;
  bool logarithmic = false;     // of x, which must then be positive
  std::vector<double> x_ticks;  // labelled values, if space permits; empty: automatic
  double y_top = 0;             // value at the upper end; 0: automatic
};

// Bar charts below each other, then the line charts: one at full width, several two per row.
// Legends are at the right, outside of the axes. A name has the same colour and marker in all
// line charts; the measures of bars have colours of their own.
struct Figure {
  std::string title;
  std::string subtitle;  // may be empty
  std::vector<BarChart> bar_charts;
  std::vector<LineChart> line_charts;
};

// 3 channels, 920 pixels wide, as high as needed. Throws kInvalidArgument "plot_invalid" when there
// is nothing to draw, values are not finite or out of range, or lengths differ.
Image DrawFigure(const Figure& figure);

}  // namespace pliant::plot
