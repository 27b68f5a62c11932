// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Values along one side of a chart, and the numbers written there. Internal to this room.
#pragma once

#include <string>
#include <vector>

namespace pliant::plot {

class Axis {
 public:
  // `low` is shown at `low_px`, `high` at `high_px`. Both positive where logarithmic.
  Axis(double low, double high, double low_px, double high_px, bool logarithmic = false);

  // In pixels; values beyond an end are shown at it.
  double operator()(double value) const;
  double low() const { return low_; }
  double high() const { return high_; }

 private:
  double Place(double value) const;

  double low_, high_;
  double low_px_, high_px_;
  bool logarithmic_;
};

// 1, 2 or 5 times a power of ten: the least for which at most `most` steps reach over `span` > 0.
double NiceStep(double span, int most);

// The multiples of NiceStep within [low, high], ascending.
std::vector<double> NiceTicks(double low, double high, int most);

// With as many decimals, three at most, as the least exact of them needs to be right within 2 %.
std::vector<std::string> TickTexts(const std::vector<double>& ticks);

std::string NumberText(double value, int decimals);

}  // namespace pliant::plot
