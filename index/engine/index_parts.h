// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// An index in parts: each process holds the images of one share (IndexShare), and a search ranks
// all parts. The ranking is the same as that of one index, bit by bit, on processors of one kind.
//
// A search has two steps, since a query descriptor's votes weigh less the more images of the whole
// index it votes for. First each part counts these images, and keeps its votes under the search's
// token. Then it gets the sums over all parts, and returns its best images. A server without the
// votes, because it was not asked first, collects them again. It refuses if it counts others than
// the first one did: a change came between. Then the search begins again.
//
// Messages are bare values one after the other, in the byte order of the machine (little-endian, as
// the database's). Only processes of one version understand each other.
#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace pliant {

// Asks the servers that hold parts: one state of the configuration. Thread-safe.
class PartServers {
 public:
  using Clock = std::chrono::steady_clock;
  struct Reply {
    std::string body;
    std::size_t server = 0;  // which of the part's
  };
  using Replies = std::vector<std::optional<Reply>>;  // by part; nullopt: none came in time

  virtual ~PartServers() = default;
  virtual std::chrono::milliseconds timeout() const = 0;  // of a ranking
  // Asks one server of each part, at the same time. In the second step `first` has the replies of
  // the first one: only the parts with a reply are asked. Its server gets `to_kept`, which needs
  // its votes, and all others get `whole`.
  virtual Replies Ask(const std::string& whole, const std::string& to_kept, const Replies& first,
                      Clock::time_point until) = 0;
};

}  // namespace pliant
