// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>

namespace pliant {

// The time since it was made, by a clock that never jumps.
class Stopwatch {
 public:
  double ms() const { return Passed(Clock::now()) * 1000; }
  double seconds() const { return Passed(Clock::now()); }
  // Milliseconds since it was made or since the last lap; begins the next one.
  double LapMs() {
    const Clock::time_point now = Clock::now();
    const double passed_ms = Passed(now) * 1000;
    start_ = now;
    return passed_ms;
  }

 private:
  using Clock = std::chrono::steady_clock;
  double Passed(Clock::time_point now) const {
    return std::chrono::duration<double>(now - start_).count();
  }
  Clock::time_point start_ = Clock::now();
};

// Adds the milliseconds that it lives to a sum.
class ScopedStopwatch {
 public:
  explicit ScopedStopwatch(double* sum_ms) : sum_ms_(*sum_ms) {}
  ~ScopedStopwatch() { sum_ms_ += watch_.ms(); }
  ScopedStopwatch(const ScopedStopwatch&) = delete;
  ScopedStopwatch& operator=(const ScopedStopwatch&) = delete;

 private:
  double& sum_ms_;
  Stopwatch watch_;
};

}  // namespace pliant
