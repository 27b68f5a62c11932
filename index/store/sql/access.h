// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One opened database: connections for reading, and a queue for writing. This is the common part of
// the database systems; their folders implement the rest. Private to index/store/. Thread-safe.
// Throws only Error.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "index/records/records.h"
#include "index/store/change_feed.h"
#include "index/store/open_store.h"
#include "index/store/sql/connection.h"

namespace pliant {

struct WriteOptions {
  bool reclaim = false;  // a large removal: return space to the file system after the commit
  // In its own transaction, which sees only committed data. For work with effects outside the
  // database, such as removing files: it must not depend on changes that can be rolled back.
  bool alone = false;
};

// One writer for many threads, with group commit: a thread that finds no writer runs all waiting
// work in ONE transaction (with a savepoint for each), and commits once. Thread-safe.
class WriteQueue {
 public:
  using Work = std::function<void(Connection& db)>;

  // `after_commit` runs after each commit and before the callers return, one thread at a time.
  // `reclaim` runs before it if any work requests that. If `after_commit` throws, the callers still
  // return, as their work is durable. Then writing stops: the next batch calls it again first.
  // While it throws, all work is refused with kInternal "writing_stopped".
  WriteQueue(std::unique_ptr<Connection> connection, std::function<void()> after_commit,
             Work reclaim = {})
      : connection_(std::move(connection)),
        after_commit_(std::move(after_commit)),
        reclaim_(std::move(reclaim)) {
    batch_.reserve(kMostTogether);
  }

  // Returns when `work` is committed and durable. An exception from `work` rolls back only its own
  // changes and is thrown here. A failing transaction fails all work in it. `work` can run again
  // after a rollback, so it must change only the database and its own result.
  void Run(Work work, const WriteOptions& options = {});

 private:
  struct Job {
    Work work;
    WriteOptions options;
    std::exception_ptr failure = {};
    bool done = false;
  };
  static constexpr std::ptrdiff_t kMostTogether = 64;  // in one transaction

  void TakeBatch();  // from the front of jobs_; mutex_ held; does not throw
  void Execute() noexcept;
  void CatchUp();
  void Reclaim();
  void RunInSavepoint(Job& job);

  std::mutex mutex_;  // guards jobs_, busy_ and Job::done
  std::condition_variable changed_;
  std::deque<Job*> jobs_;
  bool busy_ = false;
  // Owned by the thread that runs a batch:
  std::vector<Job*> batch_;
  const std::unique_ptr<Connection> connection_;
  const std::function<void()> after_commit_;
  const Work reclaim_;
  bool behind_ = false;  // after_commit_ has failed since it last ran to its end
};

class Access {
 public:
  virtual ~Access() = default;

  // The database's name for people: a path, or an address without a password.
  virtual const std::string& name() const = 0;
  // An identifier of the database, the same under all its names.
  virtual std::string Identity() = 0;

  // Enables Write. `after_commit` runs after each commit and before the callers return.
  void BeginWriting(std::function<void()> after_commit);
  bool writes() const { return writer_ != nullptr; }

  virtual std::unique_ptr<ReadTransaction> BeginReading() = 0;

  // Runs `work` in a read transaction.
  template <typename Work>
  auto Read(Work&& work) {
    return Guarded([&] {
      const std::unique_ptr<ReadTransaction> reading = BeginReading();
      return work(reading->db());
    });
  }
  // Runs `work` in the writer's transaction; see WriteQueue::Run. kReadOnly "read_only" before
  // BeginWriting.
  void Write(WriteQueue::Work work, const WriteOptions& options = {});
  // Runs `work` in a transaction of its own connection: before BeginWriting.
  void WriteAlone(const std::function<void(Connection& db)>& work);
  // Runs `work` and throws only Error.
  template <typename Work>
  auto Guarded(Work&& work) {
    try {
      return work();
    } catch (...) {
      ThrowAsError();
      throw;
    }
  }

  // Changes with every commit of any process.
  virtual std::int64_t Version() = 0;
  // Within a transaction of `db`.
  virtual FeedPosition Position(Connection& db) = 0;
  // Throws kNoSpace "no_space" unless `bytes` and the reserve fit on the disk of the directory, by
  // default that of the database, where this process can see it.
  virtual void RequireSpace(std::uint64_t bytes, const std::filesystem::path& directory = {}) const;
  virtual std::uint64_t SizeBytes() = 0;  // of the database, on disk
  // Adds the problems of the database itself, below its rows. false: its tables are not Pliant's
  // and must not be read.
  virtual bool CheckStructure(Connection& db, std::vector<std::string>* problems) = 0;
  virtual void Backup(const std::filesystem::path& target, const std::stop_token& stop) = 0;
  // Store::FollowOthers.
  virtual std::jthread FollowOthers(const std::function<void()>& /*wake*/) { return {}; }
  virtual std::optional<DatabaseServerRecord> ServerFigures() { return {}; }

  // This process's name as an owner of jobs, and whether a named process lives (ServiceStore).
  virtual const std::string& Owner() = 0;
  virtual bool Lives(const std::string& owner) = 0;

 protected:
  virtual std::unique_ptr<Connection> OpenWriter() = 0;
  virtual void BeforeWrite() {}                // can refuse by throwing
  virtual void BeforeCommit() {}               // likewise
  virtual void Reclaim(Connection& /*db*/) {}  // after a large removal
  // Throws the Error for the current exception if that is the database's.
  virtual void ThrowAsError() {}

 private:
  std::unique_ptr<WriteQueue> writer_;
};

// Part of the database: each part has its own sequence of changes.
enum class StorePart { kImages, kService };

// Opens the database as a file or on a server, by the form of its name. Creates the tables of a new
// database if `options.create` is set. Refuses databases that are not Pliant's.
std::unique_ptr<Access> OpenFileAccess(const StoreOptions& options, StorePart part);
std::unique_ptr<Access> OpenServerAccess(const StoreOptions& options, StorePart part);
std::unique_ptr<Access> OpenAccess(const StoreOptions& options, StorePart part);

}  // namespace pliant
