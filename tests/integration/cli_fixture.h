// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// `pliant index` and `pliant query` on small folders, for the parts of the command line's tests.
#pragma once

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/integration/program.h"

namespace pliant::testing {

using Json = nlohmann::json;

class CliTest : public ::testing::Test {
 protected:
  // objects/oN/view.png for N in 1..count
  void WriteObjects(int count) {
    for (int i = 1; i <= count; ++i) {
      WriteBytes(folder_ / "objects" / ("o" + std::to_string(i)) / "view.png",
                 RandomPng(static_cast<std::uint64_t>(i)));
    }
  }
  ProgramResult Index(std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {"index",        objects_,   "--db",  db_,
                                          "--descriptor", "rootsift", "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunProgram(arguments);
  }
  Json Query(std::uint64_t seed, std::vector<std::string> more = {}) {
    WriteBytes(folder_ / "query.png", OtherViewPng(seed));
    std::vector<std::string> arguments = {"query", (folder_ / "query.png").string(), "--db", db_,
                                          "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult result = RunProgram(arguments);
    EXPECT_EQ(result.status, 0) << result.err;
    return result.json();
  }

  TemporaryFolder folder_;
  std::string db_ = (folder_ / "x.db").string();
  std::string objects_ = (folder_ / "objects").string();
};

}  // namespace pliant::testing
