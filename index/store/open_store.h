// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Where a store comes from: the one place that knows which engine keeps it.
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
  bool create = true;  // make it if it does not exist; else kNotFound "database_not_found"
  bool read_only = false;
  std::function<DescriptorInfo()> model_of_new;  // asked only when it is made
  int busy_timeout_ms = 10'000;                  // wait for another process's write lock
  std::uint64_t reserve_bytes = 0;               // of the disk, which images may not take
};

// Throws kNotFound, kCorrupt ("not a Pliant database", "other_schema"), kUnavailable.
std::unique_ptr<Store> OpenStore(const StoreOptions& options);

// The database must exist. Throws kNotFound "database_not_found" and what OpenStore throws for
// files that are no database.
std::unique_ptr<ServiceStore> OpenServiceStore(const std::filesystem::path& database);

// Makes the tables of a database on a server, if they are not there: a URL (database_url.h). Throws
// what OpenStore throws.
void InitializeDatabase(const std::string& url);

// Reads the whole file, writes nothing, and throws kCorrupt "database_corrupt" when its pages, its
// keys or its counts contradict each other: it is damaged, or lies beside the log of another one.
// As fast as the disk can be read, and under a second per GB. No file is no error.
void CheckDatabaseFile(const std::filesystem::path& database);

struct RestoreResult {
  std::uint64_t images = 0;
  std::filesystem::path before;  // where that is now what was there; empty = nothing was
};

// Makes `database` a copy of `backup`, which is checked as a whole first, in one step: whenever it
// is interrupted, the database is the old one or the new one. With `replace` it takes the place,
// owner and mode of an existing one, even of one that is cut short or damaged inside, which is kept
// with its log beside it as NAME.before-restore-TIME. Throws kNotFound "backup_not_found" and
// "no_such_directory", kConflict "database_exists", kUnavailable "database_in_use", kCorrupt
// "backup_damaged" and "not_a_database", and what a full disk throws; then nothing was changed.
RestoreResult RestoreDatabase(const std::filesystem::path& backup,
                              const std::filesystem::path& database, bool replace);

// Whether what RestoreDatabase has set aside still lies beside the database: it may be put back,
// and needs its originals.
bool IsSetAside(const std::filesystem::path& database);

// Removes the incomplete copies that killed processes have left in a directory of backups, once
// they are a minute old. Returns how many. Never throws.
std::uint64_t RemoveAbandonedBackups(const std::filesystem::path& directory);

}  // namespace pliant
