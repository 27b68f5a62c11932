// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The database file: created completely or not at all, recognised before it is opened. Private to
// index/.
#pragma once

#include <cstdint>
#include <filesystem>
#include <stop_token>

#include <SQLiteCpp/Database.h>

#include "descriptor/features/descriptor.h"
#include "index/store/sqlite/sqlite_connection.h"

namespace pliant {

inline constexpr std::uint32_t kApplicationId = 0x504C4E54;  // "PLNT", at byte 68 of the file

// Makes all tables in an empty database and sets user_version to kSchemaVersion (refusals.h).
void MakeTables(SQLite::Database& database);

enum class FileState { kAbsent, kEmpty, kPliant };

// Looks at the file's first bytes without opening it with SQLite. Throws kCorrupt "not_a_database"
// (another kind of file, which stays unchanged) or "database_truncated", kNotFound when it cannot
// be read.
FileState InspectDatabaseFile(const std::filesystem::path& path);

// Makes a new database with the collection `default`, written to a temporary file and then given
// its name in one step. An existing database is left alone (another process was faster).
void CreateDatabase(const std::filesystem::path& path, const DescriptorInfo& model);

// Copies the database of `source` over the empty file `target`, while it is in use. `stop`: then
// kCancelled "cancelled".
void CopyDatabase(SqliteConnection& source, const std::filesystem::path& target,
                  const std::stop_token& stop = {});

// Copies it to the new file `target`, completely or not at all: temporary file, fsync, rename.
// First removes files of killed processes from that directory. Throws kConflict "backup_exists"
// when `target` exists.
void BackupDatabase(SqliteConnection& source, const std::filesystem::path& target,
                    const std::stop_token& stop = {});

}  // namespace pliant
