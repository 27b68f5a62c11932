// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Asks other servers for their parts of the index, over HTTP. The file of --peers is read again
// when it changes, so the layout can be switched while searches go on.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "index/engine/index_parts.h"
#include "server/peers/peer_layout.h"

namespace pliant::server {

// How one request to a server of a part ended.
enum class PeerOutcome {
  kAnswered,
  kRefused,   // the part, or the server, is in another state
  kFailed,    // no answer, or an error
  kOvertaken  // another server answered first
};
const char* PeerOutcomeName(PeerOutcome outcome);

// Of one server, as it said last.
struct PeerState {
  int part = 0;    // 1..
  int server = 0;  // 1.., as the file lists the part's
  bool answers = false;
  std::int64_t followed = 0;  // Engine::followed
  std::string database{};     // Engine::database
};

// Thread-safe.
class Peers {
 public:
  using OnRequest = std::function<void(std::size_t part, PeerOutcome outcome, double seconds)>;

  // Throws what ReadPeerLayout throws.
  Peers(std::filesystem::path file, OnRequest on_request);

  // By the file as it is now. A file that became invalid, or went away, is logged, and the last
  // valid one counts.
  std::shared_ptr<PartServers> Current();
  // Asked every few seconds.
  std::vector<PeerState> states() const;

 private:
  class Servers;

  const std::filesystem::path file_;
  const OnRequest on_request_;
  std::shared_ptr<Servers> CurrentServers();
  void Watch(const std::stop_token& stop);

  mutable std::mutex mutex_;  // guards the rest
  std::filesystem::file_time_type read_at_{};
  std::shared_ptr<Servers> current_;
  std::vector<PeerState> states_;
  std::condition_variable_any stopped_;
  std::jthread watcher_;  // last: it uses the others
};

}  // namespace pliant::server
