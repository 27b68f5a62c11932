// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// `pliant cluster quorum`: how many replicas of a shard must have a write before it is
// acknowledged. Kept in the table `settings` on every node; writers look at it once they have the
// lock for writing, and it changes under that lock alone.
#pragma once

#include <chrono>
#include <cstddef>
#include <vector>

#include "index/records/shard_record.h"
#include "index/store/clickhouse/clickhouse_store.h"

namespace pliant::clickhouse {

struct QuorumReport {
  std::size_t chosen = 0;       // 0: auto
  std::size_t acknowledge = 0;  // what that comes to
  std::size_t replicas = 0;     // of the shard with the fewest, as ClickHouse is configured
  std::vector<ShardRecord> shards;
};

// Throws what ClusterLink throws.
QuorumReport ReadQuorum(ClusterAccess& cluster);

// `chosen`: 0 = auto, or a number of replicas. Throws, and then nothing has changed:
//   kInvalidArgument "quorum_too_large": a shard has fewer replicas; "quorum_too_small": 1 where
//     they are more than two, of which rows without a quorum would be hidden later,
//   kUnavailable "replica_behind": more replicas are demanded than before, and some do not answer
//     or have not got all that was acknowledged by fewer within `wait`,
//   kUnavailable "node_unavailable": written, but it did not reach all nodes that answer: again.
//   What Keeper::Lock and ClusterLink throw.
QuorumReport SetQuorum(ClusterAccess& cluster, std::size_t chosen,
                       std::chrono::steady_clock::duration wait = std::chrono::seconds(60));

}  // namespace pliant::clickhouse
