// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The HTTP interface of each single node of a cluster.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "index/store/clickhouse/cluster_state.h"
#include "index/store/clickhouse/http_pool.h"

namespace pliant::clickhouse {

// Not thread-safe.
class NodePools {
 public:
  NodePools(const DatabaseUrl& url, const std::string& password);

  // Asks the hosts of the URL, and the machines of `nodes` at the port of the URL's first host,
  // which nodes they are. Again: only for those that are not known yet.
  void Find(const std::vector<NodeState>& nodes);

  // Null: none that answered was this node.
  HttpPool* Of(const NodeState& node) const;

 private:
  using Place = std::pair<std::uint64_t, std::uint64_t>;  // shard and replica

  void Ask(const HostPort& host);
  bool Knows(const std::vector<NodeState>& nodes) const;

  const DatabaseUrl url_;
  const std::string password_;
  std::map<Place, std::unique_ptr<HttpPool>> pools_;
};

}  // namespace pliant::clickhouse
