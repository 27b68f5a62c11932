// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant db copy
#pragma once

#include <cstdint>
#include <filesystem>

#include "index/cli/command.h"

namespace pliant::cli {

struct CopyCommandOptions {
  std::filesystem::path from;
  std::filesystem::path to;
  std::uint64_t compare = 100;  // rankings, afterwards
  int commit_every = 250;
  bool json = false;
};

ExitStatus RunCopy(const CopyCommandOptions& options);

}  // namespace pliant::cli
