// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/plot/axis.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>

namespace pliant::plot {

Axis::Axis(double low, double high, double low_px, double high_px, bool logarithmic)
    : low_(low), high_(high), low_px_(low_px), high_px_(high_px), logarithmic_(logarithmic) {}

double Axis::Place(double value) const { return logarithmic_ ? std::log(value) : value; }

double Axis::operator()(double value) const {
  const double span = Place(high_) - Place(low_);
  if (!(span > 0)) return 0.5 * (low_px_ + high_px_);
  const double share = (Place(std::clamp(value, low_, high_)) - Place(low_)) / span;
  return low_px_ + share * (high_px_ - low_px_);
}

double NiceStep(double span, int most) {
  const double least = span / most;
  const double power = std::pow(10.0, std::floor(std::log10(least)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= least * (1 - 1e-9)) return factor * power;
  }
  return 10 * power;
}

std::vector<double> NiceTicks(double low, double high, int most) {
  if (!(high > low)) return {low};
  const double step = NiceStep(high - low, most);
  const double slack = 1e-6 * step;
  std::vector<double> ticks;
  const auto first = static_cast<std::int64_t>(std::ceil((low - slack) / step));
  const auto last = static_cast<std::int64_t>(std::floor((high + slack) / step));
  for (std::int64_t i = first; i <= last; ++i) ticks.push_back(static_cast<double>(i) * step);
  return ticks;
}

std::vector<std::string> TickTexts(const std::vector<double>& ticks) {
  int decimals = 0;
  const auto exact = [&decimals](double tick) {
    const double shown = std::round(tick * std::pow(10.0, decimals)) / std::pow(10.0, decimals);
    return std::abs(shown - tick) <= 0.02 * std::abs(tick);
  };
  while (decimals < 3 && !std::all_of(ticks.begin(), ticks.end(), exact)) ++decimals;
  std::vector<std::string> texts;
  texts.reserve(ticks.size());
  for (const double tick : ticks) texts.push_back(NumberText(tick, decimals));
  return texts;
}

std::string NumberText(double value, int decimals) {
  std::array<char, 352> text{};  // the longest double has 309 digits
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

}  // namespace pliant::plot
