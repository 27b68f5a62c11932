// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/unix_time.h"

#include <array>
#include <chrono>
#include <ctime>

namespace pliant {

std::int64_t NowMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::string FormatUtc(std::int64_t unix_ms, const char* format) {
  using std::chrono::floor;
  const std::time_t seconds =
      floor<std::chrono::seconds>(std::chrono::milliseconds(unix_ms)).count();
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  std::array<char, 64> text{};
  std::strftime(text.data(), text.size(), format, &utc);
  return text.data();
}

}  // namespace pliant
