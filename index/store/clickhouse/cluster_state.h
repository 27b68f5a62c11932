// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What the nodes of a cluster say about themselves, and what is wrong with it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "index/store/clickhouse/statements.h"

namespace pliant::clickhouse {

struct TableState {
  std::string engine;
  std::vector<TableColumn> columns;
  std::string key;  // the sorting key, where this ClickHouse tells it
  std::uint64_t rows = 0;
  std::uint64_t bytes = 0;
  std::uint64_t parts = 0;
  std::uint64_t mutations = 0;  // not done yet
  // Of replicated tables.
  bool replicated = false;
  std::uint64_t replicas = 0;
  std::uint64_t active_replicas = 0;
  std::uint64_t lag_s = 0;
  std::uint64_t queue = 0;
  bool read_only = false;  // it has no Keeper: reading only
  // The contents; only after ReadChecksums.
  std::optional<std::uint64_t> count;
  std::optional<std::uint64_t> checksum;
};

struct NodeState {
  std::uint64_t shard = 0;         // numbered from 1, as in system.clusters
  std::uint64_t replica = 0;       // in its shard
  HostPort address;                // of ClickHouse's own protocol
  std::string error;               // why it could not be asked; empty: it answered
  std::string name;                // the macro {replica}
  std::string shard_name;          // the macro {shard}
  std::int64_t clock_ahead_s = 0;  // of this machine's; 0 when it cannot be told from the answer
  std::map<std::string, TableState> tables;
  std::string settings;     // the fixed ones; empty: none
  std::size_t quorum = 0;   // as chosen; 0 = nothing was
  std::string shard_names;  // of all shards, as the settings say; empty: they do not

  std::string Text() const;  // "s1r2 (10.0.0.2:9000)"
};

struct ClusterState {
  std::vector<NodeState> nodes;

  std::size_t Shards() const;
  std::size_t Replicas() const;                 // of the shard with the fewest
  std::vector<std::string> ShardNames() const;  // the macro {shard} of each, sorted
};

// Every problem a sentence; none = sound. Looks at nothing but `state`.
std::vector<std::string> FindProblems(const ClusterState& state);

}  // namespace pliant::clickhouse
