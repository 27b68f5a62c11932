// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/statements.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "index/store/clickhouse/registry_text.h"

namespace pliant::clickhouse {
namespace {

std::string Path(const DatabaseUrl& url, const TableSpec& table) {
  const std::string shard = table.placement == Placement::kShard ? "{shard}" : "all";
  return "'/clickhouse/tables/" + shard + "/" + url.database + "/" + table.name + "','{replica}'";
}

std::string Engine(const DatabaseUrl& url, const TableSpec& table) {
  std::string engine = table.replacing ? "ReplicatedReplacingMergeTree(" : "ReplicatedMergeTree(";
  engine += Path(url, table);
  if (!table.version.empty()) engine += ", " + table.version;
  return engine + ")";
}

// A picture's number is used for one attempt to store it, and written first. All rows of a number
// are on the shard of the picture's id, and so are all states of that id.
std::vector<TableSpec> DescriptionTables() {
  return {
      // A bag of words (word_codec.h): what a ranker in memory is made of.
      {.name = "words",
       .columns = {{"vocabulary", "UInt32"}, {"picture", "UInt32"}, {"data", "String"}},
       .partition = "vocabulary",
       .order = "picture",
       .granularity = 16},
      {.name = "features",
       .columns = {{"picture", "UInt32"}, {"data", "String"}},
       .order = "picture",
       .granularity = 1},
      {.name = "originals",
       .columns = {{"sha256", "FixedString(32)"}, {"data", "String"}},
       .replacing = true,
       .order = "sha256",
       .granularity = 1},
  };
}

// Every state that a picture has had, so that a reader sees all shards as they were at one commit.
std::vector<TableSpec> RecordTables() {
  return {
      {.name = "pictures",
       .columns = {{"collection", "UInt32"},
                   {"id", "String"},
                   {"version", "UInt64"},
                   {"deleted", "UInt8"},
                   {"picture", "UInt32"},
                   {"content", "UInt8"},
                   {"object", "String"},
                   {"sha256", "FixedString(32)"},
                   {"media_type", "String"},
                   {"width", "UInt32"},
                   {"height", "UInt32"},
                   {"bytes", "UInt64"},
                   {"keypoints", "UInt32"},
                   {"metadata", "String"},
                   {"source", "String"},
                   {"added_ms", "Int64"},
                   {"updated_ms", "Int64"}},
       .order = "(collection, id, version)",
       .granularity = 256},
      // Where to look. They may hold too much, never too little.
      {.name = "by_sha256",
       .columns = {{"sha256", "FixedString(32)"}, {"collection", "UInt32"}, {"id", "String"}},
       .replacing = true,
       .order = "(sha256, collection, id)",
       .granularity = 256},
      {.name = "by_object",
       .columns = {{"collection", "UInt32"}, {"object", "String"}, {"id", "String"}},
       .replacing = true,
       .order = "(collection, object, id)",
       .granularity = 256},
  };
}

std::vector<TableSpec> CommonTables() {
  return {
      // The commits: a state is there when it stands here. One block is one commit, over all
      // shards.
      {.name = "log",
       .columns = {{"version", "UInt64"},
                   {"before", "UInt64"},
                   {"collection", "UInt32"},
                   {"id", "String"},
                   {"deleted", "UInt8"},
                   {"picture", "UInt32"},
                   {"object", "String"}},
       .order = "version",
       .granularity = 256},
      // Collections, aliases, vocabularies, keys, jobs.
      {.name = "registry",
       .columns = {{"kind", "String"},
                   {"name", "String"},
                   {"version", "UInt64"},
                   {"deleted", "UInt8"},
                   {"body", "String"}},
       .replacing = true,
       .version = "version",
       .order = "(kind, name)",
       .granularity = 64},
      {.name = "vocabulary_words",
       .columns = {{"vocabulary", "UInt32"},
                   {"word", "UInt32"},
                   {"data", "String"},
                   {"thresholds", "String"}},
       .partition = "vocabulary",
       .order = "word",
       .granularity = 64},
      {.name = "settings",
       .placement = Placement::kEverywhere,
       .columns = {{"name", "String"}, {"version", "UInt64"}, {"body", "String"}},
       .replacing = true,
       .version = "version",
       .order = "name",
       .granularity = 64},
  };
}

}  // namespace

const TableSpec& Table(std::string_view name) {
  for (const TableSpec& table : Tables()) {
    if (table.name == name) return table;
  }
  throw Error(ErrorCode::kInternal, "database_error", "there is no table of this name");
}

const std::vector<TableSpec>& Tables() {
  static const std::vector<TableSpec> tables = [] {
    std::vector<TableSpec> all;
    for (const auto& room : {DescriptionTables(), RecordTables(), CommonTables()}) {
      all.insert(all.end(), room.begin(), room.end());
    }
    return all;
  }();
  return tables;
}

std::string CreateDatabase(const DatabaseUrl& url) {
  return "CREATE DATABASE IF NOT EXISTS " + url.database + " ON CLUSTER " + url.cluster;
}

std::string CreateTable(const DatabaseUrl& url, const TableSpec& table, const Dialect& dialect) {
  std::string columns;
  for (const TableColumn& column : table.columns) {
    columns += (columns.empty() ? "" : ", ") + column.name + " " + column.type;
  }
  std::string text = "CREATE TABLE IF NOT EXISTS " + url.database + "." + table.name +
                     " ON CLUSTER " + url.cluster + " (" + columns +
                     ") ENGINE = " + Engine(url, table);
  if (!table.partition.empty()) text += " PARTITION BY " + table.partition;
  text += " ORDER BY " + table.order +
          " SETTINGS index_granularity = " + std::to_string(table.granularity);
  return text + dialect.more_table_settings;
}

Settings FixedSettings(std::size_t replicas) {
  Settings settings = {
      // Acknowledged is what so many replicas have: with two, both, and any may answer.
      {"insert_quorum", InsertQuorum(WriteQuorum(replicas, 0))},
      // A replica that lags does not answer in place of one that does not.
      {"fallback_to_stale_replicas_for_distributed_queries", "0"},
      {"max_replica_delay_for_distributed_queries", "1"},
      // A shard without any replica is an error, never half an answer.
      {"skip_unavailable_shards", "0"}};
  // With three, the third may lack what the quorum has.
  if (replicas > 2) settings.emplace_back("select_sequential_consistency", "1");
  return settings;
}

std::size_t WriteQuorum(std::size_t replicas, std::size_t chosen) {
  return chosen != 0 ? chosen : std::min<std::size_t>(replicas, 2);
}

std::string InsertQuorum(std::size_t write_quorum) {
  return std::to_string(write_quorum < 2 ? 0 : write_quorum);
}

std::string FixedSettingsText(std::size_t shards, std::size_t replicas) {
  std::string text = "{\"schema\":1,\"shards\":" + std::to_string(shards) +
                     ",\"replicas\":" + std::to_string(replicas);
  for (const auto& [name, value] : FixedSettings(replicas)) text += ",\"" + name + "\":" + value;
  return text + "}";
}

std::string ShardNamesText(const std::vector<std::string>& names) { return RegistryText(names); }

std::vector<std::string> ReadShardNames(const std::string& body) {
  try {
    return nlohmann::json::parse(body).get<std::vector<std::string>>();
  } catch (const nlohmann::json::exception&) {
    throw Error(ErrorCode::kCorrupt, "settings_corrupt",
                "the cluster's list of its shards cannot be read");
  }
}

std::string QuorumText(std::size_t chosen) { return RegistryText({{"write_quorum", chosen}}); }

std::size_t ReadQuorumText(const std::string& body) {
  try {
    return nlohmann::json::parse(body).at("write_quorum").get<std::size_t>();
  } catch (const nlohmann::json::exception&) {
    throw Error(ErrorCode::kCorrupt, "settings_corrupt",
                "the quorum in the cluster's settings cannot be read");
  }
}

}  // namespace pliant::clickhouse
