// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/write_queue.h"

#include <algorithm>
#include <utility>

#include <sqlite3.h>

namespace pliant {
void WriteQueue::Run(Work work, const WriteOptions& options) {
  Job job;
  job.alone = options.alone;
  job.work = std::move(work);
  job.options = options;
  queue_.Run(job, [this](std::span<GroupQueue::Job* const> batch) { Execute(batch); });
}

void WriteQueue::Execute(std::span<GroupQueue::Job* const> batch) noexcept {
  try {
    connection_->EndLeftOver();
    SQLite::Transaction transaction(connection_->database(),
                                    SQLite::TransactionBehavior::IMMEDIATE);
    for (GroupQueue::Job* job : batch) RunInSavepoint(static_cast<Job&>(*job));
    transaction.commit();
  } catch (...) {
    for (GroupQueue::Job* job : batch) {
      if (!job->failure) job->failure = std::current_exception();
    }
    return;
  }
  try {
    if (std::any_of(batch.begin(), batch.end(), [](const GroupQueue::Job* job) {
          return static_cast<const Job*>(job)->options.reclaim && !job->failure;
        })) {
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
