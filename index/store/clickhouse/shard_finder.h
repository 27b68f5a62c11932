// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which server is of which shard. Private to store/clickhouse.
#pragma once

#include <map>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "index/store/clickhouse/http_pool.h"
#include "index/store/clickhouse/statements.h"

namespace pliant::clickhouse {

struct FoundShard {
  std::string name;             // the macro {shard}
  std::vector<HostPort> hosts;  // of the URL, those that do not answer now too
  std::size_t answering = 0;    // of them
};

struct FoundShards {
  std::vector<FoundShard> shards;  // in the order of their names
  std::size_t replicas = 0;        // of the shard with the fewest
  bool complete = true;            // every server of the URL answered
};

// One thread at a time. It remembers which server was of which shard: one that does not answer
// later is still known.
class ShardFinder {
 public:
  // `partial`: a shard that nobody has answered for is there without hosts, and is no error.
  ShardFinder(DatabaseUrl url, std::string password, bool partial)
      : url_(std::move(url)), password_(std::move(password)), partial_(partial) {}

  // Asks all servers of the URL at once, within seconds. Throws kUnavailable "shard_unavailable"
  // where some shard is not known yet, kNotFound "cluster_unknown" and "database_not_found",
  // kConflict "cluster_differs", and what HttpPool throws when no server answers that ever did.
  FoundShards Find(const std::stop_token& stop);

  HttpPoolOptions Options(std::vector<HostPort> hosts) const;

 private:
  const DatabaseUrl url_;
  const std::string password_;
  const bool partial_;
  std::map<std::string, std::string> shards_;  // the shard's name, by HostPort::Text()
  std::set<std::string> names_;                // of all shards
  std::size_t count_ = 0;                      // of shards; 0 = not known
  std::size_t replicas_ = 0;
};

}  // namespace pliant::clickhouse
