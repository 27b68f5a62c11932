// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/progress.h"

#include <algorithm>
#include <cmath>
#include <iostream>

#include <unistd.h>

#include "index/cli/output.h"

namespace pliant::cli {
namespace {

constexpr auto kInterval = std::chrono::milliseconds(200);

std::string TimeLeft(double seconds) {
  const auto left = static_cast<std::int64_t>(std::ceil(std::min(seconds, 1e7)));
  const auto two = [](std::int64_t n) { return (n < 10 ? "0" : "") + std::to_string(n); };
  const std::string minutes = left >= 3600 ? std::to_string(left / 3600) + ":" + two(left / 60 % 60)
                                           : std::to_string(left / 60);
  return minutes + ":" + two(left % 60) + " left";
}

}  // namespace

std::string ProgressLine(const std::string& unit, std::uint64_t done, std::uint64_t total,
                         double seconds) {
  if (total == 0) return {};
  std::string line = "  " + std::to_string(done) + "/" + std::to_string(total) + " " + unit + "  " +
                     std::to_string(100 * done / total) + " %";
  if (done == 0 || seconds <= 0) return line;
  const double rate = static_cast<double>(done) / seconds;
  return line + "  " + FormatFixed(rate, rate < 100 ? 1 : 0) + "/s  " +
         TimeLeft(static_cast<double>(total - done) / rate);
}

std::string ShareLine(const std::string& what, double share, double seconds) {
  std::string line = "  " + what + "  " + FormatFixed(std::floor(100 * share), 0) + " %";
  if (share <= 0.02) return line;
  return line + "  " + TimeLeft(seconds * (1 - share) / share);
}

Progress::Progress(std::string unit)
    : unit_(std::move(unit)),
      enabled_(::isatty(STDERR_FILENO) == 1),
      start_(std::chrono::steady_clock::now()) {}

Progress::~Progress() { Clear(); }

double Progress::Seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

bool Progress::IsDue() {
  const auto now = std::chrono::steady_clock::now();
  if (!enabled_ || now - shown_ < kInterval) return false;
  shown_ = now;
  return true;
}

void Progress::Show(const std::string& line) {
  const std::size_t rest = width_ > line.size() ? width_ - line.size() : 0;
  std::cerr << '\r' << line << std::string(rest, ' ') << std::flush;
  width_ = line.size();
}

void Progress::Count(std::uint64_t done, std::uint64_t total) {
  const std::lock_guard lock(mutex_);
  if (IsDue()) Show(ProgressLine(unit_, done, total, Seconds()));
}

void Progress::Share(double share) {
  const std::lock_guard lock(mutex_);
  if (IsDue()) Show(ShareLine(unit_, share, Seconds()));
}

void Progress::Clear() {
  const std::lock_guard lock(mutex_);
  if (width_ == 0) return;
  Show("");
  std::cerr << '\r' << std::flush;
  width_ = 0;
}

}  // namespace pliant::cli
