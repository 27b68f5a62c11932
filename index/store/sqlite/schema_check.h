// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Whether a database's tables, indices and triggers are Pliant's. A file from elsewhere may have a
// view in place of a table, on which a query never ends, or a trigger that works on every write.
// Private to index/.
#pragma once

#include <string>
#include <vector>

#include "index/store/sqlite/sqlite_connection.h"

namespace pliant {

// Everything in the schema must be, to the letter, what MakeTables makes, and all of that must be
// there. The operator's own tables, indices and views are left, but triggers are refused. One
// sentence a problem; empty = sound, or of another version than this program's.
std::vector<std::string> CheckSchema(SqliteConnection& db);

}  // namespace pliant
