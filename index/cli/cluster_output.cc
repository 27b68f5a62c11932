// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/cluster_output.h"

#include "descriptor/base/format_bytes.h"
#include "index/cli/output.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

std::string Joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

Json TableDocument(const std::string& name, const clickhouse::TableState& table) {
  Json document{{"table", ToDisplayText(name)}, {"engine", ToDisplayText(table.engine)},
                {"rows", table.rows},           {"bytes", table.bytes},
                {"parts", table.parts},         {"mutations", table.mutations}};
  if (table.replicated) {
    document["replicas"] = table.replicas;
    document["active_replicas"] = table.active_replicas;
    document["lag_seconds"] = table.lag_s;
    document["queue"] = table.queue;
    document["read_only"] = table.read_only;
  }
  return document;
}

}  // namespace

std::string InitText(const clickhouse::InitReport& report) {
  const std::string nodes = std::to_string(report.nodes) + (report.nodes == 1 ? " node" : " nodes");
  std::string text;
  if (!report.made.empty()) text += "made on " + nodes + ": " + Joined(report.made) + "\n";
  if (!report.present.empty()) text += "there already: " + Joined(report.present) + "\n";
  return text + (report.settings_written ? "wrote the cluster's settings"
                                         : "the cluster's settings are as they should be");
}

Json InitDocument(const clickhouse::InitReport& report) {
  return {{"nodes", report.nodes},
          {"made", report.made},
          {"present", report.present},
          {"settings_written", report.settings_written}};
}

std::string StatusText(const clickhouse::ClusterState& state) {
  std::vector<std::vector<std::string>> rows;
  std::string silent;
  for (const clickhouse::NodeState& node : state.nodes) {
    if (!node.error.empty()) {
      silent += "\n" + node.Text() + " does not answer: " + ToDisplayText(node.error);
      continue;
    }
    if (node.tables.empty()) silent += "\n" + node.Text() + " has no tables";
    for (const auto& [name, table] : node.tables) {
      if (!table.replicated) continue;  // it only reads the others
      rows.push_back({ToDisplayText(node.name), ToDisplayText(name), std::to_string(table.rows),
                      FormatBytes(table.bytes), std::to_string(table.parts),
                      std::to_string(table.active_replicas) + "/" + std::to_string(table.replicas),
                      std::to_string(table.lag_s), std::to_string(table.queue),
                      std::to_string(table.mutations), table.read_only ? "read only" : ""});
    }
  }
  std::string text = FormatTable({"node", "table", "rows", "bytes", "parts", "replicas", "lag s",
                                  "queue", "mutations", "state"},
                                 rows);
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text + silent;
}

Json StatusDocument(const clickhouse::ClusterState& state) {
  Json nodes = Json::array();
  for (const clickhouse::NodeState& node : state.nodes) {
    Json tables = Json::array();
    for (const auto& [name, table] : node.tables) tables.push_back(TableDocument(name, table));
    nodes.push_back(
        {{"shard", node.shard},
         {"replica", node.replica},
         {"name", ToDisplayText(node.name)},
         {"address", ToDisplayText(node.address.Text())},
         {"answers", node.error.empty()},
         {"error", node.error.empty() ? Json(nullptr) : Json(ToDisplayText(node.error))},
         {"clock_ahead_seconds", node.clock_ahead_s},
         {"tables", std::move(tables)}});
  }
  return {{"nodes", std::move(nodes)}};
}

std::string QuorumText(const clickhouse::QuorumReport& report) {
  std::string text = report.chosen == 0 ? "auto: " : "";
  text += std::to_string(report.acknowledge) + " of " + std::to_string(report.replicas) +
          (report.replicas == 1 ? " replica" : " replicas") + " of each shard must have a write";
  for (const ShardRecord& shard : report.shards) {
    const std::uint64_t active = shard.state ? shard.state->active_replicas : 0;
    text += "\nshard " + std::to_string(shard.number) + ": " + std::to_string(active) + " at work" +
            (active < report.acknowledge ? ": writes are refused" : "");
  }
  return text;
}

Json QuorumDocument(const clickhouse::QuorumReport& report) {
  Json shards = Json::array();
  for (const ShardRecord& shard : report.shards) {
    shards.push_back(
        {{"shard", shard.number},
         {"replicas", shard.replicas},
         {"answering", shard.answering},
         {"active", shard.state ? Json(shard.state->active_replicas) : Json(nullptr)}});
  }
  return {{"quorum", report.chosen == 0 ? Json("auto") : Json(report.chosen)},
          {"acknowledge", report.acknowledge},
          {"replicas", report.replicas},
          {"shards", std::move(shards)}};
}

std::string PurgeText(const clickhouse::PurgeReport& report) {
  if (report.readers > 0) {
    return "removed nothing: " + std::to_string(report.readers) +
           (report.readers == 1 ? " process still reads" : " processes still read") +
           " an older state; try again later";
  }
  const auto count = [](std::uint64_t number, const char* what) {
    return std::to_string(number) + " " + what;
  };
  std::string text =
      "to be removed: " + count(report.states, "old states, ") +
      count(report.removals, "removals, ") + count(report.descriptions, "features and words, ") +
      count(report.originals, "pictures' bytes, ") + count(report.places, "entries, ") +
      count(report.registry, "of the registry, ") +
      count(report.vocabularies, "partitions of vocabularies");
  if (!report.behind.empty()) {
    text += "\nleft alone, not done with earlier removals: " + Joined(report.behind);
  }
  if (!report.all_replicas) {
    text += "\nremovals stay until all replicas answer, and the URL names them";
  }
  return text;
}

Json PurgeDocument(const clickhouse::PurgeReport& report) {
  return {{"states", report.states},
          {"removals", report.removals},
          {"descriptions", report.descriptions},
          {"originals", report.originals},
          {"entries", report.places},
          {"registry", report.registry},
          {"vocabularies", report.vocabularies},
          {"readers", report.readers},
          {"behind", report.behind},
          {"all_replicas", report.all_replicas}};
}

}  // namespace pliant::cli
