// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One opened database: connections that read, and a queue that writes. What the databases share is
// written here once; the rooms of the databases implement the rest. Private to index/store/.
// Thread-safe. Lets out only Error.
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
  bool reclaim = false;  // it removes much: give space back to the file system after the commit
  // In a transaction without others' work, which sees nothing but what is committed. For work with
  // effects outside the database, such as removing files: it must not act on what may be undone.
  bool alone = false;
};

// One writer for many threads, with group commit: a thread that finds no writer runs all waiting
// work in ONE transaction (a savepoint each), and commits it once. Thread-safe.
class WriteQueue {
 public:
  using Work = std::function<void(Connection& db)>;

  // `after_commit` runs after each commit and before the callers return, one thread at a time;
  // `reclaim` before it, where a work asks for that. When `after_commit` throws, the callers return
  // all the same, as their work is durable. Then writing stops: the next batch calls it again
  // first, and while it throws, all work is refused with kInternal "writing_stopped".
  WriteQueue(std::unique_ptr<Connection> connection, std::function<void()> after_commit,
             Work reclaim = {})
      : connection_(std::move(connection)),
        after_commit_(std::move(after_commit)),
        reclaim_(std::move(reclaim)) {
    batch_.reserve(kMostTogether);
  }

  // Returns when `work` is committed and durable. What `work` throws undoes only its own changes
  // and is thrown here; a failing transaction fails every work in it. `work` may run once more
  // than its effects are kept, so it must not change anything but the database and its own result.
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
  // What follows is owned by the thread that runs a batch.
  std::vector<Job*> batch_;
  const std::unique_ptr<Connection> connection_;
  const std::function<void()> after_commit_;
  const Work reclaim_;
  bool behind_ = false;  // after_commit_ has failed since it last ran to its end
};

class Access {
 public:
  virtual ~Access() = default;

  // What people call the database: a path, or an address without a password.
  virtual const std::string& name() const = 0;
  // What tells it from every other database, also under other names.
  virtual std::string Identity() = 0;

  // From here on Write works; `after_commit` runs after each commit and before the callers return.
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
  // Runs `work` and lets out only Error.
  template <typename Work>
  auto Guarded(Work&& work) {
    try {
      return work();
    } catch (...) {
      ThrowAsError();
      throw;
    }
  }

  // Differs from what it was whenever somebody has committed in between.
  virtual std::int64_t Version() = 0;
  // Within a transaction of `db`.
  virtual FeedPosition Position(Connection& db) = 0;
  // Throws kNoSpace "no_space" unless `bytes` and the reserve fit on the disk of the directory, by
  // default that of the database, where this process can see it.
  virtual void RequireSpace(std::uint64_t bytes, const std::filesystem::path& directory = {}) const;
  virtual std::uint64_t SizeBytes() = 0;  // of the database, on disk
  // Adds what is wrong with the database itself, below its rows. False: nothing may be asked of its
  // tables, as they are not Pliant's.
  virtual bool CheckStructure(Connection& db, std::vector<std::string>* problems) = 0;
  virtual void Backup(const std::filesystem::path& target, const std::stop_token& stop) = 0;
  // Store::FollowOthers.
  virtual std::jthread FollowOthers(std::function<void()> /*wake*/) { return {}; }
  virtual std::optional<DatabaseServerRecord> ServerFigures() { return {}; }

  // The name under which this process has jobs, and whether the process of a name lives
  // (ServiceStore).
  virtual const std::string& Owner() = 0;
  virtual bool Lives(const std::string& owner) = 0;

 protected:
  virtual std::unique_ptr<Connection> OpenWriter() = 0;
  virtual void BeforeWrite() {}                // may refuse by throwing
  virtual void BeforeCommit() {}               // likewise
  virtual void Reclaim(Connection& /*db*/) {}  // much was removed
  // Throws the Error that stands for the exception that is being handled, if that is the
  // database's.
  virtual void ThrowAsError() {}

 private:
  std::unique_ptr<WriteQueue> writer_;
};

// Which part of the database is meant: each has changes, and an order of them, of its own.
enum class StorePart { kImages, kService };

// Makes the tables of a new database, where `options.create` says so, and refuses what is no
// database of Pliant's. One of the two, by what the database's name looks like.
std::unique_ptr<Access> OpenFileAccess(const StoreOptions& options, StorePart part);
std::unique_ptr<Access> OpenServerAccess(const StoreOptions& options, StorePart part);
std::unique_ptr<Access> OpenAccess(const StoreOptions& options, StorePart part);

}  // namespace pliant
