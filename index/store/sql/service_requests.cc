// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// ServiceStore: requests that may be sent again.
#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/unix_time.h"
#include "index/store/service_store.h"
#include "index/store/sql/access.h"

namespace pliant {
namespace {

constexpr std::int64_t kRememberedMs = std::int64_t{24} * 60 * 60 * 1000;

}  // namespace

RequestState ServiceStore::BeginRequest(const RepeatableRequest& request) {
  const std::string& self = Owner();
  const std::vector<std::uint8_t> fingerprint =
      FromHex(request.fingerprint).value_or(std::vector<std::uint8_t>{});  // the table refuses it
  RequestState state;
  access_->Write([&](Connection& db) {
    state = {};
    const std::int64_t now = NowMs();
    db.Prepare("DELETE FROM repeatable_requests WHERE begun_ms < ?")
        .Bind(now - kRememberedMs)
        .Run();
    Cursor row = db.Prepare(
        "SELECT fingerprint, owner, answer FROM repeatable_requests WHERE caller = ? AND name = ?");
    if (row.Bind(request.caller, request.name).Next()) {
      if (ToHex(row.Blob(0)) != request.fingerprint) {
        state.kind = RequestState::kOther;
        return;
      }
      if (!row.IsNull(2)) {
        state = {RequestState::kAnswered, row.Text(2)};
        return;
      }
      const std::string owner = row.Text(1);
      if (owner != self && Lives(owner)) {
        state.kind = RequestState::kRunning;
        return;
      }
    }
    db.Prepare(
          "INSERT INTO repeatable_requests (caller, name, fingerprint, owner, begun_ms) "
          "VALUES (?, ?, ?, ?, ?) ON CONFLICT (caller, name) DO UPDATE SET "
          "fingerprint = excluded.fingerprint, owner = excluded.owner, answer = NULL, "
          "begun_ms = excluded.begun_ms")
        .Bind(request.caller, request.name, fingerprint, self, now)
        .Run();
  });
  return state;
}

void ServiceStore::EndRequest(const RepeatableRequest& request,
                              const std::optional<std::string>& answer) {
  const std::string& self = Owner();
  access_->Write([&](Connection& db) {
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
  });
}

}  // namespace pliant
