// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/sqlite_service_store.h"

#include <memory>
#include <mutex>
#include <optional>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "index/files/durable_file.h"
#include "index/files/process_lock.h"
#include "index/store/database_file.h"
#include "index/store/database_url.h"
#include "index/store/open_store.h"
#include "index/store/refusals.h"
#include "index/store/sqlite/connection.h"
#include "index/store/sqlite/database.h"
#include "index/store/sqlite/schema.h"
#include "index/store/sqlite/sqlite_error.h"

namespace pliant {
namespace {

constexpr int kBusyTimeoutMs = 10'000;

// Must not open the file other than through SQLite: closing it would drop the locks that other
// connections of this process hold (POSIX), and another process would take the log away from them.
void RequireDatabase(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::file_size(path, error) > 0 && !error) return;
  throw Error(ErrorCode::kNotFound, "database_not_found",
              "there is no database " + DisplayPath(path));
}

void RequirePliant(const std::filesystem::path& path) {
  Connection db(path, Connection::Mode::kReadOnly, kBusyTimeoutMs);
  if (db.Scalar("PRAGMA application_id") == static_cast<std::int64_t>(kApplicationId)) return;
  throw Error(ErrorCode::kCorrupt, "not_a_database",
              DisplayPath(path) + " is not a Pliant database; it was left untouched");
}

}  // namespace

SqliteServiceStore::SqliteServiceStore(const std::filesystem::path& path) : path_(path) {
  WithDatabaseErrors(path_, [&] {
    RequireDatabase(path_);
    RequirePliant(path_);
    UpgradeDatabase(path_, Connection::Mode::kReadWrite, kBusyTimeoutMs);
    reader_ = std::make_unique<Connection>(path_, Connection::Mode::kReadOnly, kBusyTimeoutMs);
    writer_ = std::make_unique<Connection>(path_, Connection::Mode::kReadWrite, kBusyTimeoutMs);
  });
}

std::int64_t SqliteServiceStore::Version() {
  return Read([](Connection& db) { return db.Scalar("PRAGMA data_version"); });
}

const std::string& SqliteServiceStore::Owner() {
  const std::lock_guard lock(lock_mutex_);
  if (!lock_) lock_.emplace(path_);
  return lock_->id();
}

bool SqliteServiceStore::Lives(const std::string& owner) {
  Owner();
  const std::lock_guard lock(lock_mutex_);
  return lock_->IsHeld(owner);
}

std::vector<ApiKeyRecord> SqliteServiceStore::Keys() {
  return Read([](Connection& db) {
    Cursor row = db.Prepare(
        "SELECT id, name, scope, hash, created_ms, revoked_ms FROM api_keys ORDER BY key");
    std::vector<ApiKeyRecord> keys;
    while (row.Next()) {
      keys.push_back({row.Text(0), row.Text(1), row.Text(2), ToHex(row.Blob(3)), row.Int(4),
                      row.IsNull(5) ? 0 : row.Int(5)});
    }
    return keys;
  });
}

void SqliteServiceStore::AddKey(const ApiKeyRecord& key) {
  const std::vector<std::uint8_t> hash =
      FromHex(key.hash).value_or(std::vector<std::uint8_t>{});  // the table refuses another length
  Write([&](Connection& db) {
    db.Prepare("INSERT INTO api_keys (id, name, scope, hash, created_ms) VALUES (?, ?, ?, ?, ?)")
        .Bind(key.id, key.name, key.scope, hash, key.created_ms)
        .Run();
    return 0;
  });
}

bool SqliteServiceStore::RevokeKey(const std::string& id_or_name) {
  return Write([&](Connection& db) {
    Cursor row = db.Prepare(
        "SELECT key FROM api_keys WHERE revoked_ms IS NULL AND (id = ?1 OR name = ?1) "
        "ORDER BY id <> ?1");
    row.Bind(id_or_name);
    if (!row.Next()) return false;
    const std::int64_t key = row.Int(0);
    Cursor by_id = db.Prepare("SELECT 1 FROM api_keys WHERE revoked_ms IS NULL AND id = ?");
    if (!by_id.Bind(id_or_name).Next() && row.Next()) {
      throw refusals::KeyAmbiguous(id_or_name);
    }
    db.Prepare("UPDATE api_keys SET revoked_ms = ? WHERE key = ?").Bind(NowMs(), key).Run();
    return true;
  });
}

std::uint64_t SqliteServiceStore::ForgetRevokedKeys() {
  return Write([](Connection& db) {
    db.Prepare("DELETE FROM api_keys WHERE revoked_ms IS NOT NULL").Run();
    return static_cast<std::uint64_t>(db.changes());
  });
}

std::unique_ptr<ServiceStore> OpenServiceStore(const std::filesystem::path& database) {
  if (IsDatabaseUrl(database.string())) {
    throw Error(ErrorCode::kInvalidArgument, "database_unsupported",
                "databases with a URL cannot be opened yet; name a database file");
  }
  RequireDatabaseFile(database);
  return std::make_unique<SqliteServiceStore>(database);
}

}  // namespace pliant
