// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The database schema and its migrations. Private to index/. Tables are described in
// index/FORMAT.md.
#pragma once

#include <cstdint>
#include <span>

#include <SQLiteCpp/Database.h>

namespace pliant {

inline constexpr std::uint32_t kApplicationId = 0x504C4E54;  // "PLNT", at byte 68 of the file

// The step from schema version i to i + 1 is migration i; statements run in one transaction.
struct Migration {
  const char* sql;
};

std::span<const Migration> Migrations();
int SchemaVersion();  // that this program writes: the number of migrations

// Runs the migrations that `database` (user_version) has not seen, each in a transaction of its
// own that also moves user_version. Another process may do the same at the same time. Throws Error
// kCorrupt "newer_schema" when user_version is beyond the last migration.
void Migrate(SQLite::Database& database, std::span<const Migration> migrations);

}  // namespace pliant
