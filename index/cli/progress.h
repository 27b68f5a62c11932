// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A progress line on standard error, with rate and remaining time. Only if standard error is a
// terminal.
#pragma once

#include <cstdint>
#include <mutex>
#include <string>

#include "descriptor/base/stopwatch.h"

namespace pliant::cli {

// Thread-safe.
class Progress {
 public:
  explicit Progress(std::string unit);
  ~Progress();  // clears the line
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void Count(std::uint64_t done, std::uint64_t total);
  void Share(double share);  // fraction done, 0..1
  void Clear();              // before a message is printed

 private:
  bool IsDue();
  void Show(const std::string& line);

  const std::string unit_;
  const bool enabled_;
  const Stopwatch watch_;
  std::mutex mutex_;  // guards the rest
  double shown_ms_ = -1e9;
  std::size_t width_ = 0;
};

}  // namespace pliant::cli
