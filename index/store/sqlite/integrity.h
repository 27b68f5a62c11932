// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Finds broken invariants in a database file. Private to index/.
#pragma once

#include <string>
#include <vector>

#include "index/store/sqlite/sqlite_connection.h"

namespace pliant {

// Whether a database's tables, indices and triggers are Pliant's. A malicious file can have a view
// instead of a table, on which a query never ends, or a trigger that runs on every write. The
// schema must contain everything that MakeTables creates, with exactly the same text. The
// operator's own tables, indices and views are allowed, but triggers are refused. Returns one
// sentence per problem; empty = sound, or of another schema version.
std::vector<std::string> CheckSchema(SqliteConnection& db);

// The schema, SQLite's own checks, foreign keys, and that keys are never used again. Adds one
// sentence per problem. false: the schema is not Pliant's; its tables must not be read, as a query
// can run for ever.
bool CheckStructure(SqliteConnection& db, std::vector<std::string>* problems);

// The same, and CheckRows (sql/integrity.h); empty = sound.
std::vector<std::string> CheckDatabase(SqliteConnection& db);

// Checks without decoding: the schema, SQLite's quick check, and in databases of this schema counts
// and keys. Stops at the first problem.
std::vector<std::string> QuickCheck(SqliteConnection& db);

}  // namespace pliant
