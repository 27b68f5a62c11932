// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/cluster_state.h"

#include <algorithm>
#include <cstdlib>
#include <set>

#include "index/files/text.h"

namespace pliant::clickhouse {
namespace {

constexpr std::int64_t kMaxClockDifferenceS = 2;
constexpr std::uint64_t kMaxLagS = 60;

using Problems = std::vector<std::string>;

std::string EngineName(const TableSpec& table) {
  return table.replacing ? "ReplicatedReplacingMergeTree" : "ReplicatedMergeTree";
}

std::string WithoutSpaces(std::string text) {
  std::erase_if(text, [](char c) { return c == ' ' || c == '(' || c == ')'; });
  return text;
}

void CheckColumns(const std::string& where, const TableState& table,
                  const std::vector<TableColumn>& wanted, Problems& problems) {
  for (const TableColumn& column : wanted) {
    const auto same = [&](const TableColumn& other) { return other.name == column.name; };
    const auto found = std::find_if(table.columns.begin(), table.columns.end(), same);
    if (found == table.columns.end()) {
      problems.push_back(where + " has no column " + column.name);
    } else if (found->type != column.type) {
      problems.push_back(where + " has the column " + column.name + " as " +
                         ToDisplayText(found->type) + " and not as " + column.type);
    }
  }
  for (const TableColumn& column : table.columns) {
    const auto same = [&](const TableColumn& other) { return other.name == column.name; };
    if (std::none_of(wanted.begin(), wanted.end(), same)) {
      problems.push_back(where + " has the column " + ToDisplayText(column.name) +
                         ", which Pliant does not know");
    }
  }
}

void CheckReplicated(const std::string& where, const TableSpec& spec, const TableState& table,
                     Problems& problems) {
  if (table.engine != EngineName(spec)) {
    problems.push_back(where + " is a " + ToDisplayText(table.engine) + " and not a " +
                       EngineName(spec));
    return;
  }
  if (!table.key.empty() && WithoutSpaces(table.key) != WithoutSpaces(spec.order)) {
    problems.push_back(where + " is sorted by " + ToDisplayText(table.key) + " and not by " +
                       spec.order);
  }
  if (table.read_only) problems.push_back(where + " can only be read: it has lost its Keeper");
  if (table.active_replicas < table.replicas) {
    problems.push_back(where + " sees " + std::to_string(table.active_replicas) + " of " +
                       std::to_string(table.replicas) + " replicas at work");
  }
  if (table.lag_s > kMaxLagS) {
    problems.push_back(where + " lags " + std::to_string(table.lag_s) + " seconds behind");
  }
}

void CheckTables(const NodeState& node, Problems& problems) {
  if (node.tables.empty()) {
    problems.push_back(node.Text() + " has none of the tables: make them with cluster init");
    return;
  }
  for (const TableSpec& spec : Tables()) {
    const auto found = node.tables.find(spec.name);
    if (found == node.tables.end()) {
      problems.push_back(node.Text() + " lacks the table " + spec.name);
      continue;
    }
    const std::string where = node.Text() + ": " + spec.name;
    CheckColumns(where, found->second, spec.columns, problems);
    CheckReplicated(where, spec, found->second, problems);
  }
}

void CheckNode(const NodeState& node, const std::string& settings, const std::string& shard_names,
               Problems& problems) {
  if (!node.error.empty()) {
    problems.push_back(node.Text() + " does not answer: " + node.error);
    return;
  }
  if (node.name.empty() || node.shard_name.empty()) {
    problems.push_back(node.Text() + " does not have the macros shard and replica");
  }
  if (std::abs(node.clock_ahead_s) > kMaxClockDifferenceS) {
    problems.push_back("the clock of " + node.Text() + " is " +
                       std::to_string(std::abs(node.clock_ahead_s)) + " seconds " +
                       (node.clock_ahead_s > 0 ? "ahead of" : "behind") + " this machine's");
  }
  CheckTables(node, problems);
  if (node.tables.count("settings") == 0) return;
  if (node.settings.empty()) {
    problems.push_back(node.Text() + " does not have the cluster's settings");
  } else if (node.settings != settings) {
    problems.push_back(node.Text() + " has the settings " + ToDisplayText(node.settings) +
                       ", and this Pliant sends " + settings);
  } else if (node.shard_names != shard_names) {
    problems.push_back(node.Text() +
                       " does not have the names of the shards, or other ones: "
                       "write them with cluster init");
  }
}

void CheckNames(const ClusterState& state, Problems& problems) {
  std::map<std::string, std::string> nodes;     // by name
  std::map<std::string, std::uint64_t> shards;  // by name
  for (const NodeState& node : state.nodes) {
    if (node.name.empty()) continue;
    const auto [other, fresh] = nodes.emplace(node.name, node.address.Text());
    if (!fresh) {
      problems.push_back("the macro replica is " + ToDisplayText(node.name) + " on " +
                         other->second + " and on " + node.address.Text() +
                         ": it must be another on every node");
    }
    if (node.shard_name.empty()) continue;
    const auto [shard, first] = shards.emplace(node.shard_name, node.shard);
    if (!first && shard->second != node.shard) {
      problems.push_back("the macro shard is " + ToDisplayText(node.shard_name) + " on " +
                         node.Text() + ", as on nodes of shard " + std::to_string(shard->second));
    }
  }
}

void CheckQuorum(const ClusterState& state, Problems& problems) {
  std::set<std::size_t> chosen;
  for (const NodeState& node : state.nodes) {
    if (node.error.empty()) chosen.insert(node.quorum);
  }
  if (chosen.size() > 1) {
    problems.push_back("not all nodes know the same quorum yet: see cluster quorum");
  } else if (chosen.count(1) != 0 && state.Replicas() > 1) {
    problems.push_back(
        "one replica alone acknowledges a write (cluster quorum 1): what it has "
        "not passed on yet is lost with it; go back with cluster quorum auto");
  }
}

// Who should have the same rows has.
void CheckContents(const ClusterState& state, const TableSpec& spec, Problems& problems) {
  std::map<std::uint64_t, std::pair<const NodeState*, const TableState*>> first;
  for (const NodeState& node : state.nodes) {
    const auto found = node.tables.find(spec.name);
    if (found == node.tables.end() || !found->second.count) continue;
    const TableState& table = found->second;
    const std::uint64_t group = spec.placement == Placement::kShard ? node.shard : 0;
    const auto [place, fresh] = first.emplace(group, std::make_pair(&node, &table));
    if (fresh) continue;
    const auto [other, its] = place->second;
    if (*its->count != *table.count) {
      problems.push_back(spec.name + " has " + std::to_string(*its->count) + " rows on " +
                         other->Text() + " and " + std::to_string(*table.count) + " on " +
                         node.Text());
    } else if (its->checksum != table.checksum) {
      problems.push_back(spec.name + " has the same number of rows on " + other->Text() + " and " +
                         node.Text() + ", but not the same rows");
    }
  }
}

}  // namespace

std::string NodeState::Text() const {
  const std::string shown =
      name.empty() ? "shard " + std::to_string(shard) + " replica " + std::to_string(replica)
                   : ToDisplayText(name);
  return shown + " (" + address.Text() + ")";
}

std::size_t ClusterState::Shards() const {
  std::set<std::uint64_t> shards;
  for (const NodeState& node : nodes) shards.insert(node.shard);
  return shards.size();
}

std::size_t ClusterState::Replicas() const {
  std::map<std::uint64_t, std::size_t> counts;
  for (const NodeState& node : nodes) ++counts[node.shard];
  std::size_t least = counts.empty() ? 0 : counts.begin()->second;
  for (const auto& [shard, count] : counts) least = std::min(least, count);
  return least;
}

std::vector<std::string> ClusterState::ShardNames() const {
  std::set<std::string> names;
  for (const NodeState& node : nodes) {
    if (!node.shard_name.empty()) names.insert(node.shard_name);
  }
  return {names.begin(), names.end()};
}

std::vector<std::string> FindProblems(const ClusterState& state) {
  Problems problems;
  const std::string settings = FixedSettingsText(state.Shards(), state.Replicas());
  const std::string names = ShardNamesText(state.ShardNames());
  // While all of a shard's nodes are silent, nobody says what it is called.
  const bool all_named = state.ShardNames().size() == state.Shards();
  for (const NodeState& node : state.nodes) {
    CheckNode(node, settings, all_named ? names : node.shard_names, problems);
  }
  CheckNames(state, problems);
  CheckQuorum(state, problems);
  for (const TableSpec& spec : Tables()) CheckContents(state, spec, problems);
  return problems;
}

}  // namespace pliant::clickhouse
