// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One writer for many threads, with group commit: what waits runs in ONE transaction (a savepoint
// each), which is committed once. Private to index/store/.
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "index/store/group_queue.h"
#include "index/store/sql/connection.h"

namespace pliant {

struct WriteOptions {
  bool reclaim = false;  // it removes much: give space back to the file system after the commit
  // In a transaction without others' work, which sees nothing but what is committed. For work with
  // effects outside the database, such as removing files: it must not act on what may be undone.
  bool alone = false;
};

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
        reclaim_(std::move(reclaim)) {}

  // Returns when `work` is committed and durable. What `work` throws undoes only its own changes
  // and is thrown here; a failing transaction fails every work in it. `work` may run once more
  // than its effects are kept, so it must not change anything but the database and its own result.
  // Thread-safe.
  void Run(Work work, const WriteOptions& options = {});

 private:
  struct Job : GroupQueue::Job {
    Work work;
    WriteOptions options;
  };

  void Execute(std::span<GroupQueue::Job* const> batch) noexcept;
  void CatchUp();
  void Reclaim(std::span<GroupQueue::Job* const> batch);
  void RunInSavepoint(Job& job);

  GroupQueue queue_;
  std::unique_ptr<Connection> connection_;  // like behind_: owned by the thread that runs a batch
  std::function<void()> after_commit_;
  Work reclaim_;
  bool behind_ = false;  // after_commit_ has failed since it last ran to its end
};

}  // namespace pliant
