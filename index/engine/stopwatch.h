// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Where the time of a search goes. Private to engine/.
#pragma once

#include <chrono>

namespace pliant {

// Adds the time that it lives to a sum, in milliseconds.
class Stopwatch {
 public:
  explicit Stopwatch(double* sum_ms) : sum_ms_(*sum_ms) {}
  ~Stopwatch() {
    sum_ms_ += std::chrono::duration<double, std::milli>(Clock::now() - start_).count();
  }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  double& sum_ms_;
  Clock::time_point start_ = Clock::now();
};

}  // namespace pliant
