// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A cluster as its operator sees it: making its tables, and asking every node.
#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "index/store/clickhouse/cluster_state.h"
#include "index/store/clickhouse/node_pools.h"
#include "index/store/clickhouse/query.h"

namespace pliant::clickhouse {

struct InitReport {
  std::size_t nodes = 0;
  std::vector<std::string> made;     // tables that some node did not have
  std::vector<std::string> present;  // tables that all had
  bool settings_written = false;
};

// Thread-safe. Throws what HttpPool throws, and kNotFound "cluster_unknown" when ClickHouse's
// configuration has no cluster of that name.
class Cluster {
 public:
  // Asks the first host that answers.
  Cluster(DatabaseUrl url, const std::string& password);

  // Asks every node of system.clusters, over its own HTTP interface where that is among the URL's
  // hosts or at the same port, else, without a password, through the host that answered first.
  // Nodes that do not answer are in the state, with the reason.
  ClusterState Read();
  // Counts and checksums of all rows of the tables of Tables(), on the nodes that answered. Reads
  // everything.
  void ReadChecksums(ClusterState& state);

  // Makes what is not there yet, on every node. Throws kUnavailable "node_unavailable" before
  // anything is made when one does not answer, and kConflict "cluster_differs" when the settings
  // that it was made with are others.
  InitReport Init();

 private:
  NativeBlock Rows(const NodeState& node, const std::string& columns, const std::string& database,
                   const std::string& table, const std::string& rest,
                   const std::vector<TableColumn>& types,
                   std::chrono::milliseconds timeout = std::chrono::seconds(30));
  NativeBlock Select(HttpPool& pool, const std::string& statement,
                     const std::vector<TableColumn>& types, std::chrono::milliseconds timeout);
  void Command(const std::string& statement);
  std::string Remote(const NodeState& node, const std::string& database,
                     const std::string& table) const;
  std::vector<NodeState> ReadNodes();
  void ReadNode(NodeState& node);
  void ReadIdentity(NodeState& node);
  void ReadTables(NodeState& node);
  void ReadSizes(NodeState& node);
  void ReadReplication(NodeState& node);
  void ReadSettings(NodeState& node);
  bool WriteSettings(const ClusterState& state);

  DatabaseUrl url_;
  const bool has_password_;
  HttpPool pool_;
  NodePools nodes_;
  Dialect dialect_;
};

}  // namespace pliant::clickhouse
