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
// The same as it stands in the table `settings`, under the name "fixed".
std::string FixedSettingsText(std::size_t shards, std::size_t replicas);

}  // namespace pliant::clickhouse
