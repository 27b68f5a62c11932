// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sql/access.h"

#include <algorithm>
#include <string>
#include <system_error>
#include <utility>

#include "descriptor/base/error.h"
#include "index/store/database_url.h"

namespace pliant {

void WriteQueue::Run(Work work, const WriteOptions& options) {
  Job job{std::move(work), options};
  std::unique_lock lock(mutex_);
  jobs_.push_back(&job);
  while (!job.done) {
    changed_.wait(lock, [&] { return job.done || !busy_; });
    if (job.done) break;
    // Nothing throws before busy_ is false again, or all threads would wait for ever.
    busy_ = true;
    TakeBatch();
    lock.unlock();
    Execute();
    lock.lock();
    for (Job* each : batch_) each->done = true;
    busy_ = false;
    changed_.notify_all();
  }
  lock.unlock();
  if (job.failure) std::rethrow_exception(job.failure);
}

void WriteQueue::TakeBatch() {
  const auto is_alone = [](const Job* job) { return job->options.alone; };
  auto end = std::find_if(jobs_.begin(), jobs_.end(), is_alone);
  if (end == jobs_.begin()) ++end;
  end = std::min(end, jobs_.begin() + std::min(kMostTogether, std::ssize(jobs_)));
  batch_.assign(jobs_.begin(), end);
  jobs_.erase(jobs_.begin(), end);
}

void WriteQueue::Execute() noexcept {
  try {
    if (behind_) CatchUp();
    connection_->Rollback();  // of what a failed commit left
    connection_->BeginWrite();
    for (Job* job : batch_) RunInSavepoint(*job);
    connection_->Commit();
  } catch (...) {
    for (Job* job : batch_) {
      if (!job->failure) job->failure = std::current_exception();
    }
    connection_->Rollback();
    return;
  }
  Reclaim();
  try {
    after_commit_();
  } catch (...) {
    behind_ = true;  // what was written is durable and is reported so
  }
}

void WriteQueue::CatchUp() {
  constexpr const char* kStopped =
      "writing has stopped: the index cannot load the previous changes";
  try {
    after_commit_();
  } catch (const std::exception& error) {
    throw Error(ErrorCode::kInternal, "writing_stopped",
                std::string(kStopped) + ": " + error.what() +
                    ". Nothing that was acknowledged is lost. Run `pliant db check`.");
  } catch (...) {
    throw Error(ErrorCode::kInternal, "writing_stopped", kStopped);
  }
  behind_ = false;
}

// Nothing depends on it: space that is not given back now is given back after a later removal.
void WriteQueue::Reclaim() {
  const bool wanted = std::any_of(batch_.begin(), batch_.end(), [](const Job* job) {
    return job->options.reclaim && !job->failure;
  });
  if (!wanted || !reclaim_) return;
  try {
    reclaim_(*connection_);
  } catch (const std::exception&) {
  }
}

void WriteQueue::RunInSavepoint(Job& job) {
  connection_->Exec("SAVEPOINT job");
  try {
    job.work(*connection_);
  } catch (...) {
    // A full disk, a failing one or a lost connection may have rolled back everything already.
    if (!connection_->InTransaction()) throw;
    job.failure = std::current_exception();
    connection_->Exec("ROLLBACK TO job");
  }
  connection_->Exec("RELEASE job");
}

void Access::BeginWriting(std::function<void()> after_commit) {
  Guarded([&] {
    writer_ = std::make_unique<WriteQueue>(OpenWriter(), std::move(after_commit),
                                           [this](Connection& db) { Reclaim(db); });
  });
}

void Access::Write(WriteQueue::Work work, const WriteOptions& options) {
  if (!writer_) {
    throw Error(ErrorCode::kReadOnly, "read_only",
                "the database " + name() + " is open for reading only");
  }
  BeforeWrite();
  Guarded([&] {
    writer_->Run(
        [&](Connection& db) {
          work(db);
          BeforeCommit();
        },
        options);
  });
}

void Access::WriteAlone(const std::function<void(Connection& db)>& work) {
  BeforeWrite();
  Guarded([&] {
    const std::unique_ptr<Connection> db = OpenWriter();
    db->BeginWrite();
    work(*db);
    db->Commit();
  });
}

void Access::RequireSpace(std::uint64_t /*bytes*/,
                          const std::filesystem::path& /*directory*/) const {}

std::unique_ptr<Access> OpenAccess(const StoreOptions& options, StorePart part) {
  return IsDatabaseUrl(options.database.string()) ? OpenServerAccess(options, part)
                                                  : OpenFileAccess(options, part);
}

}  // namespace pliant
