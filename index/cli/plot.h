// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Curves as a picture.
#pragma once

#include <string>
#include <vector>

#include "descriptor/image.h"
#include "descriptor/tps.h"

namespace pliant::cli {

struct PlotSeries {
  std::string name;
  std::vector<Vec2> points;     // x ascending
  std::vector<double> spreads;  // half the length of a bar at each point; empty = no bars
};

// One chart. x runs from the lowest to the highest of all points, y from 0 to 1.
struct Plot {
  std::string title;
  std::string x_label;
  std::string y_label;
  std::vector<PlotSeries> series;
};

// Charts side by side, each with its legend; the same name has the same colour in all. 3 channels.
// Throws kInvalidArgument for nothing to draw or a point that is not finite.
Image DrawPlots(const std::vector<Plot>& plots);

}  // namespace pliant::cli
