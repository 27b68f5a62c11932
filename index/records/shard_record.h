// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How a shard of a database on several machines does. Plain values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

namespace pliant {

// What the replicas say that answer.
struct ShardState {
  std::uint64_t active_replicas = 0;  // at work, in the table that has the fewest
  std::uint64_t lag_s = 0;            // of the replica that is furthest behind
  std::uint64_t queue = 0;            // steps of replication that wait, of the longest queue
  std::uint64_t rows = 0;             // of all tables, on the replica that has most
  std::uint64_t bytes = 0;
  std::uint64_t parts = 0;
};

struct ShardRecord {
  std::size_t number = 0;           // from 1
  std::size_t replicas = 0;         // that the database's URL names
  std::size_t answering = 0;        // of these
  std::optional<ShardState> state;  // absent: none answers
};

}  // namespace pliant
