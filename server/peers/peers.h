// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Asks other servers for their parts of the index, over HTTP. The file of --peers (TOML) says which
// servers hold which parts. It is read again when it changes, so the layout can be switched while
// searches go on.
//
//   key = "plk_..."      # of scope peer; not needed where no keys are in use
//   timeout_ms = 5000    # of the ranking of one search
//   [parts]
//   1 = ["http://10.0.0.1:8080", "http://10.0.0.2:8080"]
//   2 = ["http://10.0.0.3:8080", "http://10.0.0.4:8080"]
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

namespace pliant::server {

struct PeerLayout {
  std::string key;
  std::chrono::milliseconds timeout{5000};
  std::vector<std::vector<std::string>> parts;  // addresses of the servers of each part

  bool operator==(const PeerLayout&) const = default;
};

// Throws Error kInvalidArgument "peers_invalid" that says what is wrong with the file.
PeerLayout ReadPeerLayout(const std::filesystem::path& file);

class PeerServers;  // of one state of the file

// How one request to a server of a part ended.
enum class PeerOutcome {
  kAnswered,
  kRefused,   // the part, or the server, is in another state
  kFailed,    // no answer, or an error
  kOvertaken  // another server answered first
};
inline constexpr const char* kPeerOutcomeNames[] = {"answered", "refused", "failed", "overtaken"};

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
  std::shared_ptr<PeerServers> CurrentServers();

  const std::filesystem::path file_;
  const OnRequest on_request_;
  mutable std::mutex mutex_;  // guards the rest
  std::filesystem::file_time_type read_at_{};
  std::shared_ptr<PeerServers> current_;
  std::vector<PeerState> states_;
  std::condition_variable_any stopped_;
  std::jthread watcher_;  // last: it uses the others
};

}  // namespace pliant::server
