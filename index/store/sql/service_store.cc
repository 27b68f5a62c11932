// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/service_store.h"

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/unix_time.h"
#include "index/files/text.h"
#include "index/store/open_store.h"
#include "index/store/sql/access.h"
#include "index/store/sql/rows.h"

namespace pliant {
namespace {

JobRecord ToJob(const Cursor& row) {
  JobRecord job;
  job.id = row.Text(0);
  job.kind = row.Text(1);
  job.collection = row.Text(2);
  job.parameters = row.Text(3);
  job.state = row.Text(4);
  job.done = row.Double(5);
  job.total = row.Double(6);
  job.failed = static_cast<std::uint64_t>(row.Int(7));
  job.attempts = static_cast<int>(row.Int(8));
  job.result = row.Text(9);
  job.report = row.Text(10);
  job.created_ms = row.Int(11);
  job.finished_ms = row.Int(12);
  job.owner = row.Text(13);
  job.cancel = row.Int(14) != 0;
  return job;
}

bool Save(Connection& db, const JobRecord& job) {
  const std::int64_t saved =
      db.Prepare(
            "INSERT INTO jobs (id, kind, collection, parameters, state, done, total, failed, "
            "attempts, result, report, created_ms, finished_ms, owner) "
            "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (id) DO UPDATE SET "
            "state = excluded.state, done = excluded.done, total = excluded.total, "
            "failed = excluded.failed, attempts = excluded.attempts, result = excluded.result, "
            "report = excluded.report, finished_ms = excluded.finished_ms "
            "WHERE jobs.owner = excluded.owner")
          .Bind(job.id, job.kind, job.collection, job.parameters, job.state, job.done, job.total,
                job.failed, job.attempts, job.result, job.report, job.created_ms, job.finished_ms,
                job.owner)
          .Run();
  if (saved == 0) return false;
  if (job.state != "queued" && job.state != "running") {  // nobody begins it again
    db.Prepare("DELETE FROM job_inputs WHERE job = ?").Bind(job.id).Run();
  }
  return true;
}

constexpr std::int64_t kRememberedMs = std::int64_t{24} * 60 * 60 * 1000;

}  // namespace

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
  const std::vector<std::uint8_t> hash = HashBytes(key.hash);  // the table refuses another length
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
      throw Error(ErrorCode::kConflict, "key_ambiguous",
                  "Several keys have the name \"" + Shown(id_or_name) +
                      "\". Give the id of the key to revoke.");
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

std::vector<JobRecord> ServiceStore::Jobs() {
  return access_->Read([](Connection& db) {
    Cursor row = db.Prepare(
        "SELECT id, kind, collection, parameters, state, done, total, failed, attempts, result, "
        "report, created_ms, finished_ms, owner, cancel FROM jobs ORDER BY number");
    std::vector<JobRecord> jobs;
    while (row.Next()) jobs.push_back(ToJob(row));
    return jobs;
  });
}

bool ServiceStore::SaveJob(const JobRecord& job) {
  bool saved = false;
  access_->Write([&](Connection& db) { saved = Save(db, job); });
  return saved;
}

void ServiceStore::AddJob(const JobRecord& job, std::span<const std::uint8_t> input) {
  access_->Write([&](Connection& db) {
    Save(db, job);
    db.Prepare("INSERT INTO job_inputs (job, data) VALUES (?, ?)").Bind(job.id, input).Run();
  });
}

std::optional<std::vector<std::uint8_t>> ServiceStore::JobInput(const std::string& id) {
  return access_->Read([&](Connection& db) -> std::optional<std::vector<std::uint8_t>> {
    Cursor row = db.Prepare("SELECT data FROM job_inputs WHERE job = ?");
    if (!row.Bind(id).Next()) return std::nullopt;
    return row.CopyOfBlob(0);
  });
}

void ServiceStore::AddJobItems(const std::string& id, std::uint64_t first,
                               const std::vector<std::string>& items) {
  access_->Write([&](Connection& db) {
    for (std::size_t i = 0; i < items.size(); ++i) {
      db.Prepare(
            "INSERT INTO job_items (job, number, result) VALUES (?, ?, ?) "
            "ON CONFLICT (job, number) DO UPDATE SET result = excluded.result")
          .Bind(id, first + i, items[i])
          .Run();
    }
  });
}

std::vector<std::string> ServiceStore::JobItems(const std::string& id, std::uint64_t first,
                                                int limit) {
  return access_->Read([&](Connection& db) {
    Cursor row = db.Prepare(
        "SELECT result FROM job_items WHERE job = ? AND number >= ? ORDER BY number LIMIT ?");
    row.Bind(id, first, limit);
    std::vector<std::string> items;
    while (row.Next()) items.push_back(row.Text(0));
    return items;
  });
}

bool ServiceStore::AddOnlyJob(const JobRecord& job) {
  bool added = false;
  access_->Write([&](Connection& db) {
    Cursor active = db.Prepare(
        "SELECT 1 FROM jobs WHERE kind = ? AND collection = ? AND state IN ('queued', 'running')");
    added = !active.Bind(job.kind, job.collection).Next() && Save(db, job);
  });
  return added;
}

bool ServiceStore::TakeJob(const std::string& id, const std::string& from) {
  const std::string& to = Owner();
  bool taken = false;
  access_->Write([&](Connection& db) {
    taken = db.Prepare(
                  "UPDATE jobs SET owner = ? WHERE id = ? AND owner = ? "
                  "AND state IN ('queued', 'running')")
                .Bind(to, id, from)
                .Run() > 0;
  });
  return taken;
}

void ServiceStore::RequestCancel(const std::string& id) {
  access_->Write([&](Connection& db) {
    db.Prepare("UPDATE jobs SET cancel = 1 WHERE id = ? AND state IN ('queued', 'running')")
        .Bind(id)
        .Run();
  });
}

void ServiceStore::KeepNewestJobs(std::size_t count) {
  access_->Write([&](Connection& db) {
    db.Prepare(
          "DELETE FROM jobs WHERE state NOT IN ('queued', 'running') AND number NOT IN "
          "(SELECT number FROM jobs ORDER BY number DESC LIMIT ?)")
        .Bind(count)
        .Run();
  });
}

RequestState ServiceStore::BeginRequest(const RepeatableRequest& request) {
  const std::string& self = Owner();
  const std::vector<std::uint8_t> fingerprint =
      HashBytes(request.fingerprint);  // the table refuses it
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
