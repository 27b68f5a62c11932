// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Asking every node.
#include <algorithm>
#include <chrono>
#include <utility>

#include "descriptor/base/error.h"
#include "index/store/clickhouse/cluster.h"

namespace pliant::clickhouse {
namespace {

constexpr std::chrono::seconds kShort{30};

std::int64_t NowS() {
  return std::chrono::duration_cast<std::chrono::seconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

const std::string& TextAt(const NativeBlock& rows, std::size_t column, std::size_t row) {
  return rows.columns[column].Of<std::string>()[row];
}

std::uint64_t NumberAt(const NativeBlock& rows, std::size_t column, std::size_t row) {
  return rows.columns[column].Of<std::uint64_t>()[row];
}

}  // namespace

Cluster::Cluster(DatabaseUrl url, const std::string& password)
    : url_(std::move(url)),
      has_password_(!password.empty()),
      pool_({.hosts = url_.hosts,
             .tls = url_.tls,
             .ca_file = url_.ca_file,
             .user = url_.user,
             .password = password}),
      nodes_(url_, password),
      dialect_(DetectDialect(pool_)) {}

NativeBlock Cluster::Select(HttpPool& pool, const std::string& statement,
                            const std::vector<TableColumn>& types,
                            std::chrono::milliseconds timeout) {
  DatabaseRequest request;
  request.statement = statement;
  request.repeatable = true;
  request.timeout = timeout;
  request.settings = {{"connect_timeout_with_failover_ms", "2000"}};
  return ReadRows(pool, request, types);
}

std::string Cluster::Remote(const NodeState& node, const std::string& database,
                            const std::string& table) const {
  std::string text = url_.tls && dialect_.has_remote_secure ? "remoteSecure(" : "remote(";
  text += Literal(node.address.Text()) + ", " + Literal(database) + ", " + Literal(table);
  if (!url_.user.empty()) text += ", " + Literal(url_.user);
  return text + ")";
}

NativeBlock Cluster::Rows(const NodeState& node, const std::string& columns,
                          const std::string& database, const std::string& table,
                          const std::string& rest, const std::vector<TableColumn>& types,
                          std::chrono::milliseconds timeout) {
  const std::string select = "SELECT " + columns + " FROM ";
  if (HttpPool* pool = nodes_.Of(node)) {
    return Select(*pool, select + database + "." + table + " " + rest, types, timeout);
  }
  // A password would be a part of the statement, and so come into logs and lists of queries.
  if (has_password_) {
    throw Error(ErrorCode::kUnavailable, "node_unavailable",
                "no HTTP interface that answers says that it is this node; name that of each node "
                "in the URL");
  }
  return Select(pool_, select + Remote(node, database, table) + " " + rest, types, timeout);
}

std::vector<NodeState> Cluster::ReadNodes() {
  const NativeBlock rows = Select(
      pool_,
      "SELECT toUInt64(shard_num) AS shard, toUInt64(replica_num) AS replica, host_name AS host, "
      "toUInt64(port) AS port FROM system.clusters WHERE cluster = " +
          Literal(url_.cluster) + " ORDER BY shard, replica",
      {{"shard", "UInt64"}, {"replica", "UInt64"}, {"host", "String"}, {"port", "UInt64"}}, kShort);
  if (rows.rows == 0) {
    throw Error(ErrorCode::kNotFound, "cluster_unknown",
                "ClickHouse's configuration (remote_servers) has no cluster " + url_.cluster);
  }
  std::vector<NodeState> nodes(rows.rows);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    nodes[i].shard = NumberAt(rows, 0, i);
    nodes[i].replica = NumberAt(rows, 1, i);
    nodes[i].address = {TextAt(rows, 2, i), static_cast<int>(NumberAt(rows, 3, i))};
  }
  return nodes;
}

void Cluster::ReadIdentity(NodeState& node) {
  const std::int64_t before = NowS();
  const NativeBlock clock = Rows(node, "toInt64(toUInt32(now())) AS seconds", "system", "one", "",
                                 {{"seconds", "Int64"}});
  const std::int64_t after = NowS();
  if (clock.rows != 1) {
    throw Error(ErrorCode::kCorrupt, "answer_corrupt", "the node does not tell the time");
  }
  const std::int64_t there = clock.columns[0].Of<std::int64_t>()[0];
  if (there < before) node.clock_ahead_s = there - before;
  if (there > after) node.clock_ahead_s = there - after;
  const NativeBlock macros = Rows(node, "macro, substitution", "system", "macros", "",
                                  {{"macro", "String"}, {"substitution", "String"}});
  for (std::size_t i = 0; i < macros.rows; ++i) {
    if (TextAt(macros, 0, i) == "replica") node.name = TextAt(macros, 1, i);
    if (TextAt(macros, 0, i) == "shard") node.shard_name = TextAt(macros, 1, i);
  }
}

void Cluster::ReadTables(NodeState& node) {
  const std::string here = "WHERE database = " + Literal(url_.database);
  const NativeBlock tables =
      Rows(node, "name, engine, sorting_key", "system", "tables", here,
           {{"name", "String"}, {"engine", "String"}, {"sorting_key", "String"}});
  for (std::size_t i = 0; i < tables.rows; ++i) {
    TableState& table = node.tables[TextAt(tables, 0, i)];
    table.engine = TextAt(tables, 1, i);
    table.key = TextAt(tables, 2, i);
  }
  const NativeBlock columns = Rows(node, "table, name, type", "system", "columns", here,
                                   {{"table", "String"}, {"name", "String"}, {"type", "String"}});
  for (std::size_t i = 0; i < columns.rows; ++i) {
    const auto table = node.tables.find(TextAt(columns, 0, i));
    if (table == node.tables.end()) continue;  // dropped just now
    table->second.columns.push_back({TextAt(columns, 1, i), TextAt(columns, 2, i)});
  }
}

void Cluster::ReadSizes(NodeState& node) {
  const std::string here = "WHERE database = " + Literal(url_.database);
  const NativeBlock parts = Rows(
      node,
      "table, toUInt64(sum(rows)) AS all_rows, toUInt64(sum(bytes_on_disk)) AS all_bytes, "
      "toUInt64(count()) AS parts",
      "system", "parts", here + " AND active GROUP BY table",
      {{"table", "String"}, {"all_rows", "UInt64"}, {"all_bytes", "UInt64"}, {"parts", "UInt64"}});
  for (std::size_t i = 0; i < parts.rows; ++i) {
    const auto table = node.tables.find(TextAt(parts, 0, i));
    if (table == node.tables.end()) continue;
    table->second.rows = NumberAt(parts, 1, i);
    table->second.bytes = NumberAt(parts, 2, i);
    table->second.parts = NumberAt(parts, 3, i);
  }
  const NativeBlock mutations =
      Rows(node, "table, toUInt64(count()) AS waiting", "system", "mutations",
           here + " AND is_done = 0 GROUP BY table", {{"table", "String"}, {"waiting", "UInt64"}});
  for (std::size_t i = 0; i < mutations.rows; ++i) {
    const auto table = node.tables.find(TextAt(mutations, 0, i));
    if (table != node.tables.end()) table->second.mutations = NumberAt(mutations, 1, i);
  }
}

void Cluster::ReadReplication(NodeState& node) {
  const NativeBlock rows =
      Rows(node,
           "table, toUInt64(total_replicas) AS replicas, toUInt64(active_replicas) AS active, "
           "toUInt64(absolute_delay) AS lag, toUInt64(queue_size) AS queue, "
           "toUInt64(is_readonly OR is_session_expired) AS read_only",
           "system", "replicas", "WHERE database = " + Literal(url_.database),
           {{"table", "String"},
            {"replicas", "UInt64"},
            {"active", "UInt64"},
            {"lag", "UInt64"},
            {"queue", "UInt64"},
            {"read_only", "UInt64"}});
  for (std::size_t i = 0; i < rows.rows; ++i) {
    const auto found = node.tables.find(TextAt(rows, 0, i));
    if (found == node.tables.end()) continue;
    TableState& table = found->second;
    table.replicated = true;
    table.replicas = NumberAt(rows, 1, i);
    table.active_replicas = NumberAt(rows, 2, i);
    table.lag_s = NumberAt(rows, 3, i);
    table.queue = NumberAt(rows, 4, i);
    table.read_only = NumberAt(rows, 5, i) != 0;
  }
}

void Cluster::ReadSettings(NodeState& node) {
  if (node.tables.count("settings") == 0) return;
  const NativeBlock rows =
      Rows(node, "name, argMax(body, version) AS text", url_.database, "settings", "GROUP BY name",
           {{"name", "String"}, {"text", "String"}});
  for (std::size_t i = 0; i < rows.rows; ++i) {
    if (TextAt(rows, 0, i) == kFixedSettings) node.settings = TextAt(rows, 1, i);
    if (TextAt(rows, 0, i) == kQuorumSettings) node.quorum = ReadQuorumText(TextAt(rows, 1, i));
    if (TextAt(rows, 0, i) == kShardNames) node.shard_names = TextAt(rows, 1, i);
  }
}

void Cluster::ReadNode(NodeState& node) {
  try {
    ReadIdentity(node);
    ReadTables(node);
    ReadSizes(node);
    ReadReplication(node);
    ReadSettings(node);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kCancelled) throw;
    // It is asked through another host: if that is the one that is gone, nothing can be said.
    if (nodes_.Of(node) == nullptr &&
        (error.reason() == "database_timeout" || error.reason() == "database_login_failed")) {
      throw;
    }
    node.error = error.what();
  }
}

ClusterState Cluster::Read() {
  ClusterState state;
  state.nodes = ReadNodes();
  nodes_.Find(state.nodes);
  for (NodeState& node : state.nodes) ReadNode(node);
  return state;
}

void Cluster::ReadChecksums(ClusterState& state) {
  for (NodeState& node : state.nodes) {
    if (!node.error.empty()) continue;
    for (const TableSpec& spec : Tables()) {
      const auto found = node.tables.find(spec.name);
      if (found == node.tables.end()) continue;
      std::string columns;
      for (const TableColumn& column : spec.columns) {
        columns += (columns.empty() ? "" : ", ") + column.name;
      }
      try {
        // FINAL: replicas merge at different times what has the same key.
        const NativeBlock rows =
            Rows(node, "toUInt64(count()) AS n, toUInt64(sum(cityHash64(" + columns + "))) AS hash",
                 url_.database, spec.name, spec.replacing ? "FINAL" : "",
                 {{"n", "UInt64"}, {"hash", "UInt64"}}, std::chrono::minutes(10));
        found->second.count = rows.rows == 0 ? 0 : NumberAt(rows, 0, 0);
        found->second.checksum = rows.rows == 0 ? 0 : NumberAt(rows, 1, 0);
      } catch (const Error& error) {
        if (error.code() == ErrorCode::kCancelled) throw;
        node.error = "while " + spec.name + " was read: " + error.what();
        break;
      }
    }
  }
}

}  // namespace pliant::clickhouse
