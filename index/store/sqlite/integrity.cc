// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/integrity.h"

#include "index/store/refusals.h"
#include "index/store/sql/integrity.h"
#include "index/store/sqlite/schema.h"
#include "index/store/sqlite/schema_check.h"

namespace pliant {
namespace {

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
