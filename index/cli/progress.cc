// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/progress.h"

#include <algorithm>
#include <cmath>
#include <iostream>

#include <fmt/format.h>
#include <unistd.h>

namespace pliant::cli {
namespace {

constexpr double kIntervalMs = 200;

// "1:05:09 left"
std::string TimeLeft(double seconds) {
  const auto left = static_cast<std::int64_t>(std::ceil(std::min(seconds, 1e7)));
  if (left < 3600) return fmt::format("{}:{:02} left", left / 60, left % 60);
  return fmt::format("{}:{:02}:{:02} left", left / 3600, left / 60 % 60, left % 60);
}

// "  120/1000 images  12 %  8.0/s  1:50 left". `total` 0: no line.
std::string ProgressLine(const std::string& unit, std::uint64_t done, std::uint64_t total,
                         double seconds) {
  if (total == 0) return {};
  const std::string line = fmt::format("  {}/{} {}  {} %", done, total, unit, 100 * done / total);
  if (done == 0 || seconds <= 0) return line;
  const double rate = static_cast<double>(done) / seconds;
  return fmt::format("{}  {:.{}f}/s  {}", line, rate, rate < 100 ? 1 : 0,
                     TimeLeft(static_cast<double>(total - done) / rate));
}

// "  training the vocabulary  45 %  0:12 left"
std::string ShareLine(const std::string& what, double share, double seconds) {
  const std::string line = fmt::format("  {}  {:.0f} %", what, std::floor(100 * share));
  return share <= 0.02 ? line : line + "  " + TimeLeft(seconds * (1 - share) / share);
}

std::mutex terminal;    // guards `width`
std::size_t width = 0;  // of the line on the terminal

void Show(const std::string& line) {
  const std::lock_guard lock(terminal);
  const std::size_t rest = width > line.size() ? width - line.size() : 0;
  std::cerr << '\r' << line << std::string(rest, ' ') << std::flush;
  width = line.size();
}

}  // namespace

void ClearProgress() {
  const std::lock_guard lock(terminal);
  if (width == 0) return;
  std::cerr << '\r' << std::string(width, ' ') << '\r' << std::flush;
  width = 0;
}

Progress::Progress(std::string unit)
    : enabled_(::isatty(STDERR_FILENO) == 1), unit_(std::move(unit)) {}

bool Progress::IsDue() {
  const double now = watch_.ms();
  if (!enabled_ || now - shown_ms_ < kIntervalMs) return false;
  shown_ms_ = now;
  return true;
}

void Progress::Count(std::uint64_t done, std::uint64_t total) {
  const std::lock_guard lock(mutex_);
  if (IsDue()) Show(ProgressLine(unit_, done, total, watch_.seconds()));
}

void Progress::Share(double share) {
  const std::lock_guard lock(mutex_);
  if (IsDue()) Show(ShareLine(unit_, share, watch_.seconds()));
}

void Progress::Step(const std::string& unit) {
  const std::lock_guard lock(mutex_);
  if (unit == unit_) return;
  unit_ = unit;
  watch_ = {};
  shown_ms_ = -1e9;
}

}  // namespace pliant::cli
