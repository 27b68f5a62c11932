// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The file of --peers (TOML): which servers hold which parts of the index.
//
//   key = "plk_..."      # of scope peer; not needed where no keys are in use
//   timeout_ms = 5000    # of the ranking of one search
//   [parts]
//   1 = ["http://10.0.0.1:8080", "http://10.0.0.2:8080"]
//   2 = ["http://10.0.0.3:8080", "http://10.0.0.4:8080"]
#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

namespace pliant::server {

struct PeerLayout {
  std::string key;
  std::chrono::milliseconds timeout{5000};
  std::vector<std::vector<std::string>> parts;  // addresses of the servers of each part

  bool operator==(const PeerLayout&) const = default;
};

// Throws Error kInvalidArgument "peers_invalid" that says what is wrong with the file.
PeerLayout ReadPeerLayout(const std::filesystem::path& file);

}  // namespace pliant::server
