// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How the shards of a cluster do. Private to store/clickhouse.
#pragma once

#include <vector>

#include "index/records/shard_record.h"
#include "index/store/clickhouse/cluster_link.h"

namespace pliant::clickhouse {

// Asks every server that the URL names, all at once; those that do not answer cost 3 s at most.
// Throws what ClusterLink throws when it connects.
std::vector<ShardRecord> ReadShardRecords(ClusterLink& link);

}  // namespace pliant::clickhouse
