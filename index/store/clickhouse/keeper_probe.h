// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which Keepers answer. The C library tries one address after the other, and stays with one that is
// silent for longer than a call may take.
#pragma once

#include <chrono>
#include <string>
#include <vector>

#include <netinet/in.h>
#include <sys/socket.h>

namespace pliant::clickhouse {

struct KeeperAddress {
  std::string text;  // "10.0.0.1:2181", "::1:2181"
  sockaddr_storage socket{};
  socklen_t length = 0;
};

// In any order, but those that serve requests first. Returns soon after the first has answered.
void SortByAnswer(std::vector<KeeperAddress>& addresses,
                  std::chrono::steady_clock::time_point until);

}  // namespace pliant::clickhouse
