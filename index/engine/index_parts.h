// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// An index in parts: each process holds the images of one share (IndexShare), and a search ranks
// all parts. The ranking is the same as that of one index, bit by bit, on processors of one kind.
//
// A search has two steps, since a query descriptor's votes weigh less the more images of the whole
// index it votes for. First each part counts these images, and keeps its votes under a token. Then
// it gets the sums over all parts, and returns its best images. A server without the votes, because
// it was not asked first, collects them again. It refuses if it counts others than the first one
// did: a change came between. Then the search begins again.
//
// Messages are MessagePack maps with values in the byte order of the machine (little-endian, as the
// database's). Only processes of one version understand each other.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace pliant {

// Asks the servers that hold parts: one state of the configuration. Thread-safe.
class PartServers {
 public:
  using Clock = std::chrono::steady_clock;
  struct Reply {
    std::string body;
    bool refused = false;    // with "part_changed"
    std::size_t server = 0;  // who it is, for the second step
  };
  struct Kept {
    std::size_t server = 0;
    std::string token;  // of the part's votes there; empty: do not ask for this part
  };

  virtual ~PartServers() = default;
  virtual int parts() const = 0;
  virtual std::chrono::milliseconds timeout() const = 0;  // of a ranking
  // Asks one server of each part, at the same time. In the second step `kept` has an element for
  // each part: its server gets `to_kept`. All others get `body()`. nullopt: none answered in time.
  virtual std::vector<std::optional<Reply>> Ask(const std::function<const std::string&()>& body,
                                                std::span<const Kept> kept,
                                                const std::string& to_kept,
                                                Clock::time_point until) = 0;
};

}  // namespace pliant
