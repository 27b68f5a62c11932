// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One state of the whole cluster. A commit is a block of the table `log`; what stands in the other
// tables counts up to the newest version there, so that all shards are seen as they were at one
// commit, whatever is written meanwhile.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>

#include "index/store/clickhouse/cluster_link.h"
#include "index/store/clickhouse/registry.h"

namespace pliant::clickhouse {

struct Snapshot {
  std::uint64_t log = 0;  // the newest version of a picture
  std::shared_ptr<const Registry> registry;
};

// Thread-safe. Throws what ClusterLink throws, kCorrupt "registry_corrupt", and kUnavailable
// "replica_behind" rather than show an older state than before.
class Snapshots {
 public:
  explicit Snapshots(ClusterLink* link) : link_(*link) {}

  // Whatever was acknowledged before the call is in it. One statement, unless the registry has
  // changed.
  Snapshot Now();
  // The version of the newest commit. One statement.
  std::uint64_t Version();

 private:
  struct Versions {
    std::uint64_t log = 0;
    std::uint64_t common = 0;  // the newest change of the registry
  };
  Versions ReadVersions();

  ClusterLink& link_;
  std::mutex mutex_;  // guards the rest
  std::uint64_t known_log_ = 0;
  std::uint64_t known_common_ = 0;
  std::shared_ptr<const Registry> registry_;
};

}  // namespace pliant::clickhouse
