// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Jobs in a database file.
#include "index/store/sqlite/sqlite_service_store.h"

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

}  // namespace

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

}  // namespace pliant
