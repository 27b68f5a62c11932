// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Runs the real programs.
#pragma once

#include <csignal>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "tests/unit/index_test_images.h"

namespace pliant::testing {

struct ProgramResult {
  int status = -1;  // exit status, or 128 + the signal that ended it
  std::string out;
  std::string err;

  nlohmann::json json() const { return nlohmann::json::parse(out); }
};

struct ProgramLimits {
  std::uint64_t max_file_bytes = 0;  // RLIMIT_FSIZE; 0 = none
  bool unprivileged = false;         // without root's rights to raise limits and to write anywhere
  std::uint64_t max_open_files = 0;  // RLIMIT_NOFILE; 0 = as usual
};

class Program {
 public:
  // Starts bin/pliant of this build, or the program at `path`.
  explicit Program(const std::vector<std::string>& arguments, const ProgramLimits& limits = {},
                   const std::filesystem::path& path = {});
  ~Program();  // kills it
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  void Signal(int number) const;
  int id() const { return pid_; }
  bool IsRunning();  // false once it has ended
  ProgramResult Wait();

  // What it has written so far.
  std::string Out() const;
  std::string Err() const;

 private:
  TemporaryFolder folder_;
  int pid_ = -1;
  int wait_status_ = 0;
  bool ended_ = false;
};

inline ProgramResult RunProgram(const std::vector<std::string>& arguments,
                                const ProgramLimits& limits = {}) {
  return Program(arguments, limits).Wait();
}

std::filesystem::path PliantPath();

}  // namespace pliant::testing
