// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A progress line on standard error, with rate and remaining time. Only if standard error is a
// terminal.
#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <string>

namespace pliant::cli {

// "  120/1000 images  12 %  8.0/s  1:50 left". `total` 0: no line.
std::string ProgressLine(const std::string& unit, std::uint64_t done, std::uint64_t total,
                         double seconds);
// "  training the vocabulary  45 %  0:12 left"
std::string ShareLine(const std::string& what, double share, double seconds);

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
  double Seconds() const;
  void Show(const std::string& line);

  const std::string unit_;
  const bool enabled_;
  const std::chrono::steady_clock::time_point start_;
  std::mutex mutex_;  // guards the rest
  std::chrono::steady_clock::time_point shown_;
  std::size_t width_ = 0;
};

}  // namespace pliant::cli
