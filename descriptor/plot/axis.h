// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The scale of one axis of a chart and its tick labels. Internal to this folder.
#pragma once

#include <string>
#include <vector>

namespace pliant::plot {

class Axis {
 public:
  // `low` is shown at `low_px`, `high` at `high_px`. Both must be positive if logarithmic.
  Axis(double low, double high, double low_px, double high_px, bool logarithmic = false);

  // Position in pixels; values beyond an end are clamped to it.
  double operator()(double value) const;
  double low() const { return low_; }
  double high() const { return high_; }

 private:
  double Place(double value) const;

  double low_, high_;
  double low_px_, high_px_;
  bool logarithmic_;
};

// 1, 2 or 5 times a power of ten: the smallest step of which at most `most` cover `span` > 0.
double NiceStep(double span, int most);

// The multiples of NiceStep within [low, high], ascending.
std::vector<double> NiceTicks(double low, double high, int most);

// Labels with the fewest decimals, at most three, that show every tick to within 2 %.
std::vector<std::string> TickTexts(const std::vector<double>& ticks);

std::string NumberText(double value, int decimals);

}  // namespace pliant::plot
