// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Tests wait for a condition, not for a time that should suffice.
#pragma once

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <thread>

namespace pliant::testing {

// False if it does not hold within half a minute.
inline bool Eventually(const std::function<bool()>& holds) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!holds()) {
    if (std::chrono::steady_clock::now() > until) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

// The state of a process or thread by its directory below /proc (proc(5), stat): 'S' while it
// waits, 'R' while it runs or could; 0 = there is none.
inline char StateOf(const std::filesystem::path& directory) {
  std::ifstream file(directory / "stat");
  std::string stat;
  std::getline(file, stat);
  const std::size_t at = stat.rfind(") ");  // "ID (NAME) S ..."
  return at == std::string::npos ? '\0' : stat[at + 2];
}

}  // namespace pliant::testing
