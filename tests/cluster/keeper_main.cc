// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Runs the tests where ZooKeeper is installed, else ends with 77 (skipped). With --hold PORT PATH
// it is a process that takes a lock, writes "held", and "lost" when it is not held any more.
#include <chrono>
#include <cstdio>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "tests/cluster/zookeeper.h"

namespace {

int Hold(int port, const std::string& path) {
  pliant::clickhouse::Keeper keeper(pliant::testing::KeeperAt(port));
  const auto until = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  const auto lock = keeper.Lock(path, until);
  std::puts("held");
  std::fflush(stdout);
  while (lock->held()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  std::puts("lost");
  std::fflush(stdout);
  for (;;) std::this_thread::sleep_for(std::chrono::seconds(1));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 4 && std::string(argv[1]) == "--hold") return Hold(std::stoi(argv[2]), argv[3]);
  ::testing::InitGoogleTest(&argc, argv);
  const std::string missing = pliant::testing::MissingForZooKeeper();
  if (!missing.empty()) {
    std::printf("Skipped: the package %s is not installed\n", missing.c_str());
    return 77;
  }
  return RUN_ALL_TESTS();
}
