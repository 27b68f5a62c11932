// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One state of the whole cluster. A commit is a block of the table `log`; what stands in the other
// tables counts up to the newest version there, so that all shards are seen as they were at one
// commit, whatever is written meanwhile.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>

#include "index/store/clickhouse/cluster_link.h"
#include "index/store/clickhouse/registry.h"

namespace pliant::clickhouse {

// The snapshots that a process has open: purging leaves alone what they show. Thread-safe.
class OpenSnapshots {
 public:
  // Nothing when none is open.
  std::optional<std::uint64_t> Oldest() const;

 private:
  friend class SnapshotHold;
  mutable std::mutex mutex_;  // guards the rest
  std::multiset<std::uint64_t> logs_;
};

class SnapshotHold {
 public:
  SnapshotHold(std::shared_ptr<OpenSnapshots> open, std::uint64_t log, std::uint64_t guard);
  ~SnapshotHold();
  SnapshotHold(const SnapshotHold&) = delete;
  SnapshotHold& operator=(const SnapshotHold&) = delete;

  void MoveTo(std::uint64_t log);  // before others see it

 private:
  friend class Snapshots;
  const std::shared_ptr<OpenSnapshots> open_;
  std::uint64_t log_;
  std::atomic<std::uint64_t> guard_;  // what has kept the snapshot since it was taken; 0 = nothing
};

struct Snapshot {
  std::uint64_t log = 0;  // the newest version of a picture
  std::shared_ptr<const Registry> registry;
  std::shared_ptr<SnapshotHold> hold;
};

// Thread-safe. Throws what ClusterLink throws, and kCorrupt "registry_corrupt".
class Snapshots {
 public:
  explicit Snapshots(ClusterLink* link) : link_(*link) {}

  // Whatever was acknowledged before the call is in it. What had no answer yet, or none at all, may
  // have been in an earlier one and not be in this: a failed insert leaves it on one replica, and
  // another one answers. One statement, unless the registry has changed.
  Snapshot Now();
  // Throws kUnavailable "replica_behind" in that case: what is written now must come after it.
  Snapshot NowForWriting();
  // The last one that this process has seen, without asking anybody: for who cannot. Throws
  // kUnavailable "shard_unavailable" where there was none, or what is common to all has changed
  // since it was read.
  Snapshot LastKnown();
  // The version of the newest commit, as Now() would have it. One statement.
  std::uint64_t Version();

  // For what reads long: throws kUnavailable "snapshot_expired" when what it shows may have been
  // purged. Asks nobody as long as the guard that the snapshot was taken under is there.
  void RequireKept(const Snapshot& snapshot);
  // Who tells others which snapshots this process has open (reader_floor.h): a number that is
  // another one whenever they may have missed something, and 0 while they cannot know. May be
  // empty.
  void SetGuard(std::function<std::uint64_t()> guard);
  const OpenSnapshots& open() const { return *open_; }

 private:
  struct Versions {
    std::uint64_t log = 0;
    std::uint64_t common = 0;  // the newest change of the registry
    bool is_behind = false;    // another replica has shown more
  };
  Versions ReadVersions();  // as the replica has them that answers
  Snapshot Take(bool for_writing);

  std::uint64_t Guard() const { return guard_ ? guard_() : 0; }

  ClusterLink& link_;
  std::function<std::uint64_t()> guard_;  // before others use this
  const std::shared_ptr<OpenSnapshots> open_ = std::make_shared<OpenSnapshots>();
  std::mutex mutex_;  // guards the rest
  std::uint64_t known_log_ = 0;
  std::uint64_t known_common_ = 0;
  std::shared_ptr<const Registry> registry_;
};

}  // namespace pliant::clickhouse
