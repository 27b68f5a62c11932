// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Asks other servers for their parts of the index, over HTTP. The file of --peers is read again
// when it changes, so the layout can be switched while searches go on.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "index/engine/index_parts.h"
#include "server/peers/peer_layout.h"

namespace pliant::server {

// How one request to a server of a part ended.
enum class PeerOutcome {
  kAnswered,
  kRefused,   // the part is in another state
  kFailed,    // no answer, or an error
  kOvertaken  // another server answered first
};
const char* PeerOutcomeName(PeerOutcome outcome);

// Of one server, as it says.
struct PeerState {
  int part = 0;  // 1..
  std::string address;
  bool answers = false;
  std::int64_t followed = 0;  // EngineSearch::followed
};

// Thread-safe.
class Peers {
 public:
  using OnRequest = std::function<void(std::size_t part, PeerOutcome outcome, double seconds)>;

  // Throws what ReadPeerLayout throws.
  Peers(std::filesystem::path file, OnRequest on_request);

  // By the file as it is now. A file that became invalid is logged, and the last valid one counts.
  std::shared_ptr<PartServers> Current();
  // Asks all servers, for at most a second.
  std::vector<PeerState> States();

 private:
  class Servers;

  const std::filesystem::path file_;
  const OnRequest on_request_;
  std::mutex mutex_;  // guards the rest
  std::filesystem::file_time_type read_at_{};
  std::shared_ptr<Servers> current_;
};

}  // namespace pliant::server
