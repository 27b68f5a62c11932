// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/write_queue.h"

#include <algorithm>
#include <array>

#include <sqlite3.h>

namespace pliant {
namespace {

constexpr std::size_t kMaxBatch = 64;

}  // namespace

std::size_t WriteQueue::NextBatch() const {
  if (!jobs_.empty() && jobs_.front()->options.alone) return 1;
  const auto end =
      std::find_if(jobs_.begin(), jobs_.end(), [](const Job* job) { return job->options.alone; });
  return std::min(static_cast<std::size_t>(end - jobs_.begin()), kMaxBatch);
}

void WriteQueue::Run(Work work, const WriteOptions& options) {
  Job job{std::move(work), options, false, nullptr};
  std::unique_lock lock(mutex_);
  jobs_.push_back(&job);
  while (!job.done) {
    changed_.wait(lock, [&] { return job.done || !busy_; });
    if (job.done) break;
    // From here to the end of the loop nothing throws: the array needs no memory, and Execute keeps
    // what it catches. Whatever left busy_ set would block every writer for ever.
    busy_ = true;
    std::array<Job*, kMaxBatch> jobs;
    const std::size_t count = NextBatch();
    std::copy_n(jobs_.begin(), count, jobs.begin());
    jobs_.erase(jobs_.begin(), jobs_.begin() + static_cast<std::ptrdiff_t>(count));
    const std::span<Job* const> batch = std::span(jobs).first(count);
    lock.unlock();
    Execute(batch);
    lock.lock();
    for (Job* each : batch) each->done = true;
    busy_ = false;
    changed_.notify_all();
  }
  lock.unlock();
  if (job.failure) std::rethrow_exception(job.failure);
}

void WriteQueue::Execute(std::span<Job* const> batch) noexcept {
  try {
    connection_->EndLeftOver();
    SQLite::Transaction transaction(connection_->database(),
                                    SQLite::TransactionBehavior::IMMEDIATE);
    for (Job* job : batch) RunInSavepoint(*job);
    transaction.commit();
  } catch (...) {
    for (Job* job : batch) {
      if (!job->failure) job->failure = std::current_exception();
    }
    return;
  }
  try {
    if (std::any_of(batch.begin(), batch.end(),
                    [](const Job* j) { return j->options.reclaim && !j->failure; })) {
      ReclaimSpace();
    }
    after_commit_();
  } catch (...) {
    // What was written is durable and must be reported so. The index in memory stays marked as out
    // of date: the next search brings it up to date or throws what is wrong.
  }
}

void WriteQueue::RunInSavepoint(Job& job) {
  SQLite::Database& database = connection_->database();
  database.exec("SAVEPOINT job");
  try {
    job.work(*connection_);
  } catch (...) {
    // A full disk or a failing one may have rolled back everything already.
    if (sqlite3_get_autocommit(database.getHandle()) != 0) throw;
    job.failure = std::current_exception();
    database.exec("ROLLBACK TO job");
  }
  database.exec("RELEASE job");
}

// Freed pages go back to the file system, and the log, which still holds what was deleted, is
// emptied. Both wait for nobody: what another process holds up is done after a later removal.
void WriteQueue::ReclaimSpace() {
  SQLite::Database& database = connection_->database();
  const std::int64_t timeout_ms = connection_->Scalar("PRAGMA busy_timeout");
  database.setBusyTimeout(0);
  if (connection_->Scalar("PRAGMA freelist_count") > 0)
    database.tryExec("PRAGMA incremental_vacuum");
  database.tryExec("PRAGMA wal_checkpoint(TRUNCATE)");
  database.setBusyTimeout(static_cast<int>(timeout_ms));
}

}  // namespace pliant
