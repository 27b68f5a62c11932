// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Opens stores. The only code that chooses the database system.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>

#include "descriptor/features/descriptor.h"
#include "index/store/service_store.h"
#include "index/store/store.h"

namespace pliant {

struct StoreOptions {
  std::filesystem::path database;  // or its URL (database_url.h)
  bool create = true;  // create a missing database; false: kNotFound "database_not_found"
  bool read_only = false;
  std::function<DescriptorInfo()> model_of_new;  // called only for a new database
  int busy_timeout_ms = 10'000;                  // wait for another process's write lock
  std::uint64_t reserve_bytes = 0;               // of the disk, which images cannot use
};

// Throws kNotFound, kCorrupt ("not a Pliant database", "other_schema"), kUnavailable.
std::unique_ptr<Store> OpenStore(const StoreOptions& options);

// The database must exist. Throws kNotFound "database_not_found" and what OpenStore throws for
// files of other kinds.
std::unique_ptr<ServiceStore> OpenServiceStore(const std::filesystem::path& database);

// Makes the tables of a database on a server, if they are not there: a URL (database_url.h). Throws
// what OpenStore throws.
void InitializeDatabase(const std::string& url);

// Writes nothing. Throws kCorrupt "database_corrupt" if the file's schema is not Pliant's, or its
// pages, keys or counts contradict each other: it is damaged, or beside the log of another
// database. Of a file of more than 2 GiB without a log, which was closed properly, only the schema
// is read: the whole would take a second per GB. A missing file is no error.
void CheckDatabaseFile(const std::filesystem::path& database);

struct RestoreResult {
  std::uint64_t images = 0;
  std::filesystem::path before;  // the new path of the replaced database; empty = none
};

// Checks the whole `backup`, then makes `database` a copy of it in one step. After any interruption
// the database is the old one or the new one. With `replace` it replaces an existing database, even
// a damaged one, and takes its owner and mode. The old one is kept with its log as
// NAME.before-restore-TIME. Throws kNotFound "backup_not_found" and "no_such_directory", kConflict
// "database_exists", kUnavailable "database_in_use", kCorrupt "backup_damaged" and
// "not_a_database", and what a full disk throws; then nothing has changed.
RestoreResult RestoreDatabase(const std::filesystem::path& backup,
                              const std::filesystem::path& database, bool replace);

// Whether a database kept by RestoreDatabase still exists beside the database. A person can restore
// it, and it needs its originals.
bool IsSetAside(const std::filesystem::path& database);

// Removes incomplete copies of killed processes from a directory of backups, once they are a minute
// old. Returns how many. Never throws.
std::uint64_t RemoveAbandonedBackups(const std::filesystem::path& directory);

}  // namespace pliant
