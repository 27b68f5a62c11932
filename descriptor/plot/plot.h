// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Bars and curves as a picture, for reports: everything the project plots is drawn here. Text is
// ASCII; what is too long for its place is cut and ends in "...".
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
    std::vector<Bar> bars;  // one a measure
  };
  std::string title;                  // may be empty
  std::vector<std::string> measures;  // what the bars of every group mean, from the top
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
  std::vector<double> x_ticks;  // where to write numbers, as far as they have room; empty: chosen
  double y_top = 0;             // value at the upper end; 0: chosen by the data
};

// Bar charts below each other, then the line charts: one over the whole width, several two a row.
// Legends stand at the right, outside of the axes. A name has the same colour and marker in all
// line charts; the measures of bars have colours of their own.
struct Figure {
  std::string title;
  std::string subtitle;  // may be empty
  std::vector<BarChart> bar_charts;
  std::vector<LineChart> line_charts;
};

// 3 channels, 920 pixels wide, as high as needed. Throws kInvalidArgument "plot_invalid" when there
// is nothing to draw, numbers are not finite or out of their range, or lengths differ.
Image DrawFigure(const Figure& figure);

}  // namespace pliant::plot
