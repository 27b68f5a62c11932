// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/integrity.h"

#include <algorithm>
#include <array>
#include <compare>

#include "index/store/refusals.h"
#include "index/store/sql/integrity.h"
#include "index/store/sqlite/database.h"

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

using Problems = std::vector<std::string>;

void CheckFile(SqliteConnection& db, Problems& problems) {
  Cursor row = db.Prepare("PRAGMA integrity_check(100)");
  while (row.Next()) {
    if (row.Text(0) != "ok") problems.push_back("SQLite: " + row.Text(0));
  }
  Cursor keys = db.Prepare("PRAGMA foreign_key_check");
  while (keys.Next()) {
    problems.push_back("a row of table " + keys.Text(0) + " refers to a missing row of " +
                       keys.Text(2));
  }
  if (db.Scalar("PRAGMA application_id") != static_cast<std::int64_t>(kApplicationId)) {
    problems.emplace_back("the application id is not Pliant's");
  }
  if (db.Scalar("PRAGMA user_version") != kSchemaVersion) {
    problems.emplace_back("the schema version is not this program's");
  }
}

// An index in memory follows the database by these: a key that is used twice would leave it wrong.
void CheckKeys(SqliteConnection& db, Problems& problems) {
  for (const char* table : {"collections", "objects", "images", "vocabularies"}) {
    const std::string name = table;
    if (db.Scalar("SELECT coalesce(max(key), 0) FROM " + name) > db.LastKey(table)) {
      problems.push_back("table " + name + ": keys that were used may be used again");
    }
  }
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

bool CheckStructure(SqliteConnection& db, Problems* problems) {
  *problems = CheckSchema(db);
  if (!problems->empty()) return false;
  try {
    CheckFile(db, *problems);
    CheckKeys(db, *problems);
  } catch (const SQLite::Exception& error) {
    problems->push_back(std::string("SQLite: ") + error.what());
  }
  return true;
}

std::vector<std::string> CheckDatabase(SqliteConnection& db) {
  Problems problems;
  if (CheckStructure(db, &problems)) CheckRows(db, &problems);
  return problems;
}

std::vector<std::string> QuickCheck(SqliteConnection& db) {
  Problems problems = CheckSchema(db);
  if (!problems.empty()) return problems;
  const std::string answer = db.Prepare("PRAGMA quick_check(1)").One().Text(0);
  if (answer != "ok") {
    problems.push_back("SQLite: " + answer);
  } else if (db.Scalar("PRAGMA user_version") == kSchemaVersion) {
    CheckCounts(db, problems);
    CheckKeys(db, problems);
  }
  return problems;
}

}  // namespace pliant
