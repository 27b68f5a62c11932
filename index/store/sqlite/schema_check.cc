// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/schema_check.h"

#include <algorithm>
#include <array>
#include <compare>

#include "index/store/refusals.h"
#include "index/store/sqlite/schema.h"

namespace pliant {
namespace {

// A row of sqlite_schema.
struct Item {
  std::string type;  // "table", "index", "view" or "trigger"
  std::string name;
  std::string table;  // that it belongs to
  std::string sql;    // empty: an index that SQLite makes for a constraint
  auto operator<=>(const Item&) const = default;

  std::string Named() const { return "the " + type + " \"" + name.substr(0, 64) + "\""; }
};

Item StatisticsTable(const std::string& name, const std::string& columns) {
  return {"table", name, name, "CREATE TABLE " + name + columns};
}

// ANALYZE and PRAGMA optimize make these.
bool IsStatistics(const Item& item) {
  static const std::array kTables = {
      StatisticsTable("sqlite_stat1", "(tbl,idx,stat)"),
      StatisticsTable("sqlite_stat4", "(tbl,idx,neq,nlt,ndlt,sample)")};
  return std::find(kTables.begin(), kTables.end(), item) != kTables.end();
}

// In order.
std::vector<Item> SchemaOf(SQLite::Database& db) {
  std::vector<Item> items;
  SQLite::Statement row(db, "SELECT type, name, tbl_name, sql FROM sqlite_schema");
  while (row.executeStep()) {
    items.push_back({row.getColumn(0).getString(), row.getColumn(1).getString(),
                     row.getColumn(2).getString(), row.getColumn(3).getString()});
  }
  std::sort(items.begin(), items.end());
  return items;
}

std::vector<Item> OwnSchema() {
  SQLite::Database model(":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  MakeTables(model);
  return SchemaOf(model);
}

}  // namespace

std::vector<std::string> CheckSchema(SqliteConnection& db) {
  if (db.Scalar("PRAGMA user_version") != kSchemaVersion) return {};
  const std::vector<Item> expected = OwnSchema();
  const std::vector<Item> found = SchemaOf(db.database());
  std::vector<std::string> problems;
  for (const Item& item : expected) {
    if (std::binary_search(found.begin(), found.end(), item)) continue;
    problems.push_back(item.Named() + " is missing or not as Pliant makes it");
  }
  for (const Item& item : found) {
    if (std::binary_search(expected.begin(), expected.end(), item) || IsStatistics(item)) continue;
    if (item.type != "trigger") continue;
    problems.push_back(item.Named() + " is not Pliant's");
  }
  return problems;
}

}  // namespace pliant
