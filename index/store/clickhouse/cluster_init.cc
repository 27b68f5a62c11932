// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Making the tables.
#include <algorithm>
#include <chrono>
#include <thread>

#include "descriptor/base/error.h"
#include "index/store/clickhouse/cluster.h"
#include "index/store/clickhouse/rows.h"

namespace pliant::clickhouse {
namespace {

constexpr std::chrono::seconds kEverywhereWithin{30};

bool AllHave(const ClusterState& state, const std::string& table) {
  return std::all_of(state.nodes.begin(), state.nodes.end(),
                     [&](const NodeState& node) { return node.tables.count(table) > 0; });
}

void RequireAllNodes(const ClusterState& state) {
  for (const NodeState& node : state.nodes) {
    if (!node.error.empty()) {
      throw Error(ErrorCode::kUnavailable, "node_unavailable",
                  node.Text() +
                      " does not answer, and tables are made on all nodes or none: " + node.error);
    }
    if (node.name.empty() || node.shard_name.empty()) {
      throw Error(ErrorCode::kConflict, "cluster_differs",
                  node.Text() + " needs the macros shard and replica in its configuration");
    }
  }
}

bool AllHaveSettings(const ClusterState& state) {
  return std::all_of(state.nodes.begin(), state.nodes.end(), [](const NodeState& node) {
    return !node.settings.empty() && !node.shard_names.empty();
  });
}

// Whether they are written on a node; other ones than these are kConflict "cluster_differs".
bool HaveSettings(const ClusterState& state, const std::string& wanted) {
  bool present = false;
  for (const NodeState& node : state.nodes) {
    if (node.settings.empty()) continue;
    present = true;
    if (node.settings != wanted) {
      throw Error(ErrorCode::kConflict, "cluster_differs",
                  "the cluster was made with the settings " + node.settings +
                      ", and this Pliant, or this number of replicas, needs " + wanted);
    }
  }
  return present;
}

}  // namespace

void Cluster::Command(const std::string& statement) {
  DatabaseRequest request;
  request.statement = statement;
  request.timeout = std::chrono::minutes(4);
  request.settings = {{"distributed_ddl_task_timeout", "180"}};
  pool_.Fetch(request);
}

// False: they are there.
bool Cluster::WriteSettings(const ClusterState& state) {
  const std::string fixed = FixedSettingsText(state.Shards(), state.Replicas());
  const std::string names = ShardNamesText(state.ShardNames());
  RowWriter rows(Table("settings").columns);
  if (!HaveSettings(state, fixed)) rows.Add(std::string_view(kFixedSettings), 1, fixed);
  const bool named = std::any_of(state.nodes.begin(), state.nodes.end(),
                                 [&](const auto& node) { return node.shard_names == names; });
  if (!named) rows.Add(std::string_view(kShardNames), 1, names);
  if (rows.empty()) return false;
  DatabaseRequest request;
  request.statement =
      "INSERT INTO " + url_.database + ".settings (name, version, body) FORMAT Native";
  request.rows = EncodeNative(rows.block());
  request.repeatable = true;  // the same row again is the same row
  pool_.Fetch(request);
  return true;
}

InitReport Cluster::Init() {
  const ClusterState before = Read();
  RequireAllNodes(before);
  HaveSettings(before,
               FixedSettingsText(before.Shards(), before.Replicas()));  // before anything is made
  InitReport report;
  report.nodes = before.nodes.size();
  Command(CreateDatabase(url_));
  const auto make = [&](const std::string& name, const std::string& statement) {
    const bool present = AllHave(before, name);
    if (!present) Command(statement);
    (present ? report.present : report.made).push_back(name);
  };
  for (const TableSpec& table : Tables()) make(table.name, CreateTable(url_, table, dialect_));
  report.settings_written = WriteSettings(Read());
  const auto until = std::chrono::steady_clock::now() + kEverywhereWithin;
  while (!AllHaveSettings(Read())) {
    if (std::chrono::steady_clock::now() > until) {
      throw Error(ErrorCode::kUnavailable, "node_unavailable",
                  "the tables are made, but what is written on one node does not reach all "
                  "others: see cluster check");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
  return report;
}

}  // namespace pliant::clickhouse
