// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// ServiceStore: jobs.
#include "index/store/service_store.h"
#include "index/store/sql/access.h"

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

}  // namespace

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

}  // namespace pliant
