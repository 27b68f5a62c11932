// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/service_store.h"

#include "descriptor/base/hex.h"
#include "descriptor/base/unix_time.h"
#include "index/store/open_store.h"
#include "index/store/refusals.h"
#include "index/store/sql/access.h"

namespace pliant {

ServiceStore::ServiceStore(std::unique_ptr<Access> access) : access_(std::move(access)) {
  access_->BeginWriting([] {});
}

ServiceStore::~ServiceStore() = default;

std::int64_t ServiceStore::Version() { return access_->Version(); }

const std::string& ServiceStore::Owner() { return access_->Owner(); }

bool ServiceStore::Lives(const std::string& owner) { return access_->Lives(owner); }

std::vector<ApiKeyRecord> ServiceStore::Keys() {
  return access_->Read([](Connection& db) {
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

void ServiceStore::AddKey(const ApiKeyRecord& key) {
  const std::vector<std::uint8_t> hash =
      FromHex(key.hash).value_or(std::vector<std::uint8_t>{});  // the table refuses another length
  access_->Write([&](Connection& db) {
    db.Prepare("INSERT INTO api_keys (id, name, scope, hash, created_ms) VALUES (?, ?, ?, ?, ?)")
        .Bind(key.id, key.name, key.scope, hash, key.created_ms)
        .Run();
  });
}

bool ServiceStore::RevokeKey(const std::string& id_or_name) {
  bool revoked = false;
  access_->Write([&](Connection& db) {
    revoked = false;
    Cursor row = db.Prepare(
        "SELECT key FROM api_keys WHERE revoked_ms IS NULL AND (id = ?1 OR name = ?1) "
        "ORDER BY id <> ?1");
    row.Bind(id_or_name);
    if (!row.Next()) return;
    const std::int64_t key = row.Int(0);
    Cursor by_id = db.Prepare("SELECT 1 FROM api_keys WHERE revoked_ms IS NULL AND id = ?");
    if (!by_id.Bind(id_or_name).Next() && row.Next()) {
      throw refusals::KeyAmbiguous(id_or_name);
    }
    db.Prepare("UPDATE api_keys SET revoked_ms = ? WHERE key = ?").Bind(NowMs(), key).Run();
    revoked = true;
  });
  return revoked;
}

std::uint64_t ServiceStore::ForgetRevokedKeys() {
  std::int64_t forgotten = 0;
  access_->Write([&](Connection& db) {
    forgotten = db.Prepare("DELETE FROM api_keys WHERE revoked_ms IS NOT NULL").Run();
  });
  return static_cast<std::uint64_t>(forgotten);
}

std::unique_ptr<ServiceStore> OpenServiceStore(const std::filesystem::path& database) {
  StoreOptions options;
  options.database = database;
  options.create = false;
  return std::make_unique<ServiceStore>(OpenAccess(options, StorePart::kService));
}

}  // namespace pliant
