// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// API keys and jobs in a database file.
#include <memory>
#include <mutex>
#include <optional>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "index/files/durable_file.h"
#include "index/files/process_lock.h"
#include "index/store/open_store.h"
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

class SqliteServiceStore : public ServiceStore {
 public:
  explicit SqliteServiceStore(const std::filesystem::path& path) : path_(path) {
    WithDatabaseErrors(path_, [&] {
      RequireDatabase(path_);
      RequirePliant(path_);
      UpgradeDatabase(path_, Connection::Mode::kReadWrite, kBusyTimeoutMs);
      reader_ = std::make_unique<Connection>(path_, Connection::Mode::kReadOnly, kBusyTimeoutMs);
      writer_ = std::make_unique<Connection>(path_, Connection::Mode::kReadWrite, kBusyTimeoutMs);
    });
  }

  std::int64_t Version() override;
  std::vector<ApiKeyRecord> Keys() override;
  void AddKey(const ApiKeyRecord& key) override;
  bool RevokeKey(const std::string& id_or_name) override;
  std::uint64_t ForgetRevokedKeys() override;
  std::vector<JobRecord> Jobs() override;
  const std::string& Owner() override;
  bool Lives(const std::string& owner) override;
  bool SaveJob(const JobRecord& job) override;
  void AddJob(const JobRecord& job, std::span<const std::uint8_t> input) override;
  std::optional<std::vector<std::uint8_t>> JobInput(const std::string& id) override;
  void AddJobItems(const std::string& id, std::uint64_t first,
                   const std::vector<std::string>& items) override;
  std::vector<std::string> JobItems(const std::string& id, std::uint64_t first, int limit) override;
  bool AddOnlyJob(const JobRecord& job) override;
  bool TakeJob(const std::string& id, const std::string& from) override;
  void RequestCancel(const std::string& id) override;
  void KeepNewestJobs(std::size_t count) override;

 private:
  static bool Save(Connection& db, const JobRecord& job);  // within a transaction

  template <typename Work>
  auto Read(Work&& work) {
    return WithDatabaseErrors(path_, [&] {
      const std::lock_guard lock(reader_mutex_);
      return work(*reader_);
    });
  }

  template <typename Work>
  auto Write(Work&& work) {
    return WithDatabaseErrors(path_, [&] {
      const std::lock_guard lock(writer_mutex_);
      writer_->EndLeftOver();
      SQLite::Transaction transaction(writer_->database(), SQLite::TransactionBehavior::IMMEDIATE);
      auto result = work(*writer_);
      transaction.commit();
      return result;
    });
  }

  const std::filesystem::path path_;
  std::mutex lock_mutex_;            // guards lock_
  std::optional<ProcessLock> lock_;  // from the first Owner()
  std::mutex reader_mutex_;          // guards reader_
  std::unique_ptr<Connection> reader_;
  std::mutex writer_mutex_;  // guards writer_
  std::unique_ptr<Connection> writer_;
};

std::int64_t SqliteServiceStore::Version() {
  return Read([](Connection& db) { return db.Scalar("PRAGMA data_version"); });
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
      throw Error(
          ErrorCode::kConflict, "key_ambiguous",
          "several keys are called \"" + id_or_name + "\"; name the id of the one to revoke");
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

std::vector<JobRecord> SqliteServiceStore::Jobs() {
  return Read([](Connection& db) {
    Cursor row = db.Prepare(
        "SELECT id, kind, collection, parameters, state, done, total, failed, attempts, result, "
        "report, created_ms, finished_ms, owner, cancel FROM jobs ORDER BY number");
    std::vector<JobRecord> jobs;
    while (row.Next()) jobs.push_back(ToJob(row));
    return jobs;
  });
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

bool SqliteServiceStore::SaveJob(const JobRecord& job) {
  return Write([&](Connection& db) { return Save(db, job); });
}

void SqliteServiceStore::AddJob(const JobRecord& job, std::span<const std::uint8_t> input) {
  Write([&](Connection& db) {
    Save(db, job);
    db.Prepare("INSERT INTO job_inputs (job, data) VALUES (?, ?)").Bind(job.id, input).Run();
    return 0;
  });
}

std::optional<std::vector<std::uint8_t>> SqliteServiceStore::JobInput(const std::string& id) {
  return Read([&](Connection& db) -> std::optional<std::vector<std::uint8_t>> {
    Cursor row = db.Prepare("SELECT data FROM job_inputs WHERE job = ?");
    if (!row.Bind(id).Next()) return std::nullopt;
    const Bytes data = row.Blob(0);
    return std::vector<std::uint8_t>(data.begin(), data.end());
  });
}

void SqliteServiceStore::AddJobItems(const std::string& id, std::uint64_t first,
                                     const std::vector<std::string>& items) {
  Write([&](Connection& db) {
    for (std::size_t i = 0; i < items.size(); ++i) {
      db.Prepare("INSERT OR REPLACE INTO job_items (job, number, result) VALUES (?, ?, ?)")
          .Bind(id, first + i, items[i])
          .Run();
    }
    return 0;
  });
}

std::vector<std::string> SqliteServiceStore::JobItems(const std::string& id, std::uint64_t first,
                                                      int limit) {
  return Read([&](Connection& db) {
    Cursor row = db.Prepare(
        "SELECT result FROM job_items WHERE job = ? AND number >= ? ORDER BY number LIMIT ?");
    row.Bind(id, first, limit);
    std::vector<std::string> items;
    while (row.Next()) items.push_back(row.Text(0));
    return items;
  });
}

bool SqliteServiceStore::AddOnlyJob(const JobRecord& job) {
  return Write([&](Connection& db) {
    Cursor active = db.Prepare(
        "SELECT 1 FROM jobs WHERE kind = ? AND collection = ? AND state IN ('queued', 'running')");
    return !active.Bind(job.kind, job.collection).Next() && Save(db, job);
  });
}

bool SqliteServiceStore::Save(Connection& db, const JobRecord& job) {
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
  if (db.changes() == 0) return false;
  if (job.state != "queued" && job.state != "running") {  // nobody begins it again
    db.Prepare("DELETE FROM job_inputs WHERE job = ?").Bind(job.id).Run();
  }
  return true;
}

bool SqliteServiceStore::TakeJob(const std::string& id, const std::string& from) {
  const std::string& to = Owner();
  return Write([&](Connection& db) {
    db.Prepare(
          "UPDATE jobs SET owner = ? WHERE id = ? AND owner = ? AND state IN ('queued', 'running')")
        .Bind(to, id, from)
        .Run();
    return db.changes() > 0;
  });
}

void SqliteServiceStore::RequestCancel(const std::string& id) {
  Write([&](Connection& db) {
    db.Prepare("UPDATE jobs SET cancel = 1 WHERE id = ? AND state IN ('queued', 'running')")
        .Bind(id)
        .Run();
    return 0;
  });
}

void SqliteServiceStore::KeepNewestJobs(std::size_t count) {
  Write([&](Connection& db) {
    db.Prepare(
          "DELETE FROM jobs WHERE state NOT IN ('queued', 'running') AND number NOT IN "
          "(SELECT number FROM jobs ORDER BY number DESC LIMIT ?)")
        .Bind(static_cast<std::int64_t>(count))
        .Run();
    return 0;
  });
}

}  // namespace

std::unique_ptr<ServiceStore> OpenServiceStore(const std::filesystem::path& database) {
  return std::make_unique<SqliteServiceStore>(database);
}

}  // namespace pliant
