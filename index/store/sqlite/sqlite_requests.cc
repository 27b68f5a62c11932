// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Requests that may be sent again, in a database file.
#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "index/store/sqlite/database.h"
#include "index/store/sqlite/sqlite_service_store.h"

namespace pliant {
namespace {

constexpr std::int64_t kRememberedMs = std::int64_t{24} * 60 * 60 * 1000;

}  // namespace

RequestState SqliteServiceStore::BeginRequest(const RepeatableRequest& request) {
  const std::string& self = Owner();
  const std::vector<std::uint8_t> fingerprint =
      FromHex(request.fingerprint).value_or(std::vector<std::uint8_t>{});  // the table refuses it
  return Write([&](Connection& db) -> RequestState {
    const std::int64_t now = NowMs();
    db.Prepare("DELETE FROM repeatable_requests WHERE begun_ms < ?")
        .Bind(now - kRememberedMs)
        .Run();
    Cursor row = db.Prepare(
        "SELECT fingerprint, owner, answer FROM repeatable_requests WHERE caller = ? AND name = ?");
    if (row.Bind(request.caller, request.name).Next()) {
      if (ToHex(row.Blob(0)) != request.fingerprint) return {RequestState::kOther, {}};
      if (!row.IsNull(2)) return {RequestState::kAnswered, row.Text(2)};
      const std::string owner = row.Text(1);
      if (owner != self && Lives(owner)) return {RequestState::kRunning, {}};
    }
    db.Prepare(
          "INSERT OR REPLACE INTO repeatable_requests (caller, name, fingerprint, owner, begun_ms) "
          "VALUES (?, ?, ?, ?, ?)")
        .Bind(request.caller, request.name, fingerprint, self, now)
        .Run();
    return {RequestState::kBegun, {}};
  });
}

void SqliteServiceStore::EndRequest(const RepeatableRequest& request,
                                    const std::optional<std::string>& answer) {
  const std::string& self = Owner();
  Write([&](Connection& db) {
    if (answer) {
      db.Prepare(
            "UPDATE repeatable_requests SET answer = ? WHERE caller = ? AND name = ? AND owner = ?")
          .Bind(*answer, request.caller, request.name, self)
          .Run();
    } else {
      db.Prepare("DELETE FROM repeatable_requests WHERE caller = ? AND name = ? AND owner = ?")
          .Bind(request.caller, request.name, self)
          .Run();
    }
    return 0;
  });
}

}  // namespace pliant
