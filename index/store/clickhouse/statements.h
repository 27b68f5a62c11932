// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The tables of a cluster, and the statements that make them. What differs between versions of
// ClickHouse comes from dialect.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "index/store/clickhouse/database_url.h"
#include "index/store/clickhouse/dialect.h"

namespace pliant::clickhouse {

enum class Placement {
  // The replicas of a shard hold the same. Pictures are divided among the shards; what is common to
  // all of them is on the first shard alone (ClusterLink::kHome).
  kShard,
  kEverywhere,  // every node holds all rows
};

struct TableColumn {
  std::string name = {};
  std::string type;

  bool operator==(const TableColumn&) const = default;
};

struct TableSpec {
  std::string name = {};
  Placement placement = Placement::kShard;
  std::vector<TableColumn> columns;
  // Rows with the same key are one, the latest (when merged). `version`: the column that says
  // which.
  bool replacing = false;
  std::string version = {};
  std::string partition = {};  // empty: none
  std::string order = {};
  std::size_t granularity = 8192;  // rows that are read together at least
};

// In the order in which they are made.
const std::vector<TableSpec>& Tables();
const TableSpec& Table(std::string_view name);

// In `vocabulary_words`: no word, but the codebook.
inline constexpr std::uint32_t kCodebookWord = 0xFFFFFFFF;

std::string CreateDatabase(const DatabaseUrl& url);
std::string CreateTable(const DatabaseUrl& url, const TableSpec& table, const Dialect& dialect);

// One fixed set for all servers of a cluster, because mixed ones hide rows: what is sent with each
// request that reads or writes, by the number of replicas that each shard has.
using Settings = std::vector<std::pair<std::string, std::string>>;
Settings FixedSettings(std::size_t replicas);

// How many replicas acknowledge a write (cluster_quorum.h): `chosen`, or where that is 0 two, or
// the one there is.
std::size_t WriteQuorum(std::size_t replicas, std::size_t chosen);
// The ClickHouse setting insert_quorum for it.
std::string InsertQuorum(std::size_t write_quorum);
// The same as it stands in the table `settings`, under the name "fixed".
std::string FixedSettingsText(std::size_t shards, std::size_t replicas);

// Names in the table `settings`: those fixed ones, and the names of all shards (the macro {shard}),
// which say which shard it is of which no server answers.
inline constexpr const char* kFixedSettings = "fixed";
inline constexpr const char* kShardNames = "shards";
// What was chosen with `pliant cluster quorum`; 0, or no row: nothing.
inline constexpr const char* kQuorumSettings = "quorum";
std::string QuorumText(std::size_t chosen);
std::size_t ReadQuorumText(const std::string& body);  // throws as ReadShardNames
std::string ShardNamesText(const std::vector<std::string>& names);
// Throws kCorrupt "settings_corrupt".
std::vector<std::string> ReadShardNames(const std::string& body);

}  // namespace pliant::clickhouse
