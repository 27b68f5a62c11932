// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Looks for everything that must hold in a database file and does not. Private to index/.
#pragma once

#include <string>
#include <vector>

#include "index/store/sqlite/sqlite_connection.h"

namespace pliant {

// Whether a database's tables, indices and triggers are Pliant's. A file from elsewhere may have a
// view in place of a table, on which a query never ends, or a trigger that works on every write.
// Everything in the schema must be, to the letter, what MakeTables makes, and all of that must be
// there. The operator's own tables, indices and views are left, but triggers are refused. One
// sentence a problem; empty = sound, or of another version than this program's.
std::vector<std::string> CheckSchema(SqliteConnection& db);

// The schema, SQLite's own checks, foreign keys, and that keys are never used again. Adds a
// sentence a problem. False: the schema is not Pliant's, and nothing may be asked of its tables, as
// the answer might never end.
bool CheckStructure(SqliteConnection& db, std::vector<std::string>* problems);

// The same, and CheckRows (sql/integrity.h); empty = sound.
std::vector<std::string> CheckDatabase(SqliteConnection& db);

// What shows without decoding anything: the schema, SQLite's quick check, and in databases of this
// schema counts and keys. The first problem is enough.
std::vector<std::string> QuickCheck(SqliteConnection& db);

}  // namespace pliant
