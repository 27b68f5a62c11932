// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Removes what nobody can read any more: states of pictures that were replaced or removed,
// features, words and uploaded bytes that no picture has, collections and vocabularies that are
// gone, and the beginning of the log.
//
// First it is written down, as a commit, what may go: states that were replaced before a moment,
// and the log up to a moment. Then it is waited until no process reads what was before that commit
// (reader_floor.h). Only then rows are removed, by lists that are made anew from what is stored, so
// that it can be interrupted anywhere, and be done again. ClickHouse removes rows in its own time.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "index/store/clickhouse/clickhouse_store.h"

namespace pliant::clickhouse {

struct PurgeOptions {
  // States go so long after they were replaced. Processes without a Keeper rely on it.
  std::chrono::seconds states_after{3600};
  // A server that has not looked at the log for so long loads its index anew.
  std::chrono::seconds log_after{7 * 24 * 3600};
  std::chrono::seconds wait{60};  // for another purge to end, and for readers of what was before
};

struct PurgeReport {
  std::uint64_t states = 0;         // of pictures, also of collections that are gone
  std::uint64_t removals = 0;       // what says that a picture is gone
  std::uint64_t descriptions = 0;   // features and words
  std::uint64_t originals = 0;      // uploaded bytes
  std::uint64_t places = 0;         // by bytes and by object
  std::uint64_t vocabularies = 0;   // partitions of their words
  std::uint64_t registry = 0;       // keys, jobs and what else is gone
  std::uint64_t readers = 0;        // that still read what was before: nothing was removed
  std::vector<std::string> behind;  // tables that are not done with earlier removals: left alone
  bool all_replicas = true;         // false: removals stay, since one did not answer
};

// Throws kConflict "purge_running", and what ClusterCommits throws.
PurgeReport Purge(ClusterAccess& cluster, const PurgeOptions& options);

}  // namespace pliant::clickhouse
