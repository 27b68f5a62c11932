// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One writer at a time in the whole cluster, with group commit. Private to store/clickhouse.
//
// Under the lock "write" of the Keeper a writer reads the newest commit, writes rows that nobody
// sees yet (their versions are greater than that of any commit), and then their commit, one block
// of the log. Where a writer ended in between, the next one commits what it finds: its versions
// would be taken for committed otherwise.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <span>

#include "index/store/clickhouse/keeper.h"
#include "index/store/clickhouse/snapshot.h"
#include "index/store/clickhouse/write_batch.h"
#include "index/store/group_queue.h"

namespace pliant::clickhouse {

inline constexpr const char* kWriteLock = "locks/write";  // of the Keeper

class ClusterCommits {
 public:
  using Work = std::function<void(Change& change)>;

  ClusterCommits(ClusterLink* link, Snapshots* snapshots, std::shared_ptr<Keeper> keeper)
      : link_(*link), snapshots_(*snapshots), keeper_(std::move(keeper)) {}

  // `after_commit` runs after each commit and before the callers return, one thread at a time.
  // Without it every Run throws kReadOnly "read_only".
  void Begin(std::function<void()> after_commit);

  // Returns when what `work` did is on as many replicas as the cluster's settings say. What it
  // throws undoes only its own changes. `work` may run once more than its effects are kept. Throws
  // kUnavailable "keeper_unavailable", "keeper_busy", and "database_outcome_unknown" when it may
  // or may not have been committed; and what ClusterLink throws. Thread-safe. `alone`: it sees
  // nothing but what is committed (Change::snapshot).
  void Run(Work work, const Foreseen& foreseen = {}, bool alone = false);
  // The same, without Begin and what runs after a commit.
  void RunAtOpening(Work work, bool alone = false);

 private:
  struct Job : GroupQueue::Job {
    Work work;
    const Foreseen* foreseen = nullptr;
  };

  void Submit(Work work, const Foreseen& foreseen, bool alone);
  void Execute(std::span<GroupQueue::Job* const> batch) noexcept;
  bool Commit(std::span<GroupQueue::Job* const> batch);
  void Recover();
  std::uint32_t NextPicture();
  Key NextKey();
  Key GreatestKey();
  std::uint32_t GreatestPicture();

  ClusterLink& link_;
  Snapshots& snapshots_;
  std::shared_ptr<Keeper> keeper_;
  std::function<void()> after_commit_;
  GroupQueue queue_;
  // Only for whoever executes a batch.
  std::uint64_t next_picture_ = 0;
  std::uint64_t end_picture_ = 0;  // of the numbers that this process may give out
};

}  // namespace pliant::clickhouse
