// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A progress line on standard error, with rate and remaining time. Only if standard error is a
// terminal.
#pragma once

#include <cstdint>
#include <mutex>
#include <string>

#include "descriptor/base/stopwatch.h"
#include "index/cli/interrupt.h"

namespace pliant::cli {

// Clears the line on the terminal, if there is one: before a message is printed (output.cc).
void ClearProgress();

// Thread-safe.
class Progress {
 public:
  explicit Progress(std::string unit);
  ~Progress() { ClearProgress(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void Count(std::uint64_t done, std::uint64_t total);
  void Share(double share);  // fraction done, 0..1
  // Begins another step, unless it is this one.
  void Step(const std::string& unit);

  // Count as a callback, and one that also says whether to go on. This and the interrupt must
  // outlive them.
  auto Counter() {
    return [this](auto done, auto total) {
      Count(static_cast<std::uint64_t>(done), static_cast<std::uint64_t>(total));
    };
  }
  auto CounterUntil(const Interrupt& interrupt) {
    return [count = Counter(), &interrupt](auto done, auto total) {
      count(done, total);
      return !interrupt.requested();
    };
  }

 private:
  bool IsDue();

  const bool enabled_;
  std::mutex mutex_;  // guards the rest
  std::string unit_;
  Stopwatch watch_;
  double shown_ms_ = -1e9;
};

}  // namespace pliant::cli
