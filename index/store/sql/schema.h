// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The tables that every database has. Private to index/store/. index/FORMAT.md describes them.
#pragma once

namespace pliant {

// Statements that create them, as in a database file. A database server has other names for the
// types (postgres/schema.cc). A file of schema 1 must have exactly this text: the checks of a
// database compare it, with the comments inside statements. Each database adds the table `removals`
// and the triggers, which keep the counts of collections, note removals and dropped originals, and
// remove what belongs to a job.
extern const char* const kTables;

}  // namespace pliant
