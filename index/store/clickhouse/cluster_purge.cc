// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/cluster_purge.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "descriptor/base/error.h"
#include "index/store/clickhouse/purge_lists.h"
#include "index/store/clickhouse/query.h"
#include "index/store/clickhouse/rows.h"

namespace pliant::clickhouse {
namespace {

constexpr const char* kOnePurge = "purge";
constexpr std::chrono::milliseconds kLookAgain{500};

std::uint64_t VersionBefore(std::chrono::seconds age) {
  const auto now = std::chrono::system_clock::now().time_since_epoch() - age;
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(now).count();
  return us < 0 ? 0 : static_cast<std::uint64_t>(us);
}

class Purger {
 public:
  Purger(ClusterAccess* cluster, const PurgeOptions& options)
      : cluster_(*cluster), options_(options) {}

  PurgeReport Run() {
    Announce();
    if (!WaitForReaders()) return report_;
    for (std::size_t shard = 0; shard < cluster_.link.shards(); ++shard) RemoveFrom(shard);
    RemoveCommon();
    return report_;
  }

 private:
  // What may go, and which keys of collections and vocabularies had been given out by then.
  void Announce() {
    cluster_.commits.RunAtOpening(
        [this](Change& change) {
          const PurgeEntry before = change.registry().purge;
          const std::uint64_t log = change.snapshot().log;
          may_.limits = {
              std::max(before.states, std::min(log, VersionBefore(options_.states_after))),
              std::max(before.log, std::min(log, VersionBefore(options_.log_after)))};
          may_.keys_below = static_cast<std::uint64_t>(change.NewKey());
          change.Set(ToRow(may_.limits));
        },
        /*alone=*/true);
    const Snapshot now = cluster_.snapshots.Now();
    announced_ = now.log;
    for (const auto& [name, entry] : now.registry->collections) {
      may_.collections.push_back(entry.key);
    }
    for (const auto& [key, entry] : now.registry->vocabularies) {
      may_.vocabularies.push_back(static_cast<std::uint64_t>(key));
    }
  }

  bool WaitForReaders() {
    const auto until = std::chrono::steady_clock::now() + options_.wait;
    while (true) {
      cluster_.readers.Publish();
      const std::vector<std::uint64_t> floors = ReadFloors(*cluster_.keeper);
      report_.readers = static_cast<std::uint64_t>(
          std::count_if(floors.begin(), floors.end(),
                        [this](std::uint64_t floor) { return floor < announced_; }));
      if (report_.readers == 0) return true;
      if (std::chrono::steady_clock::now() > until) return false;
      std::this_thread::sleep_for(kLookAgain);
    }
  }

  // A list would be made anew, and the same rows removed once more, before they are gone.
  bool IsBehind(std::size_t shard, const std::string& table) {
    const NativeBlock rows =
        cluster_.link.Read(shard,
                           "SELECT toUInt64(count()) AS left FROM system.mutations WHERE database "
                           "= " +
                               Literal(cluster_.link.url().database) +
                               " AND table = " + Literal(table) + " AND is_done = 0",
                           {{"left", "UInt64"}});
    if (rows.rows == 0 || Row(rows, 0).Number(0) == 0) return false;
    report_.behind.push_back(table + " of shard " + std::to_string(shard + 1));
    return true;
  }

  std::uint64_t Remove(std::size_t shard, const std::string& table, const std::string& key,
                       const std::vector<std::string>& values) {
    for (std::size_t from = 0; from < values.size(); from += kValuesAStatement) {
      const std::size_t to = std::min(values.size(), from + kValuesAStatement);
      cluster_.link.Command(shard, "ALTER TABLE " + table + " DELETE WHERE " + key + " IN (" +
                                       Joined({values.data() + from, values.data() + to}) + ")");
    }
    return values.size();
  }

  void RemoveFrom(std::size_t shard) {
    if (!IsBehind(shard, "pictures")) {
      RemoveCollections(shard);
      report_.states += Remove(shard, "pictures", "version",
                               ReadList(cluster_.link, shard, ReplacedStates(may_)));
      report_.removals += RemoveLast(shard, "pictures", LastRemovals(may_));
    }
    for (const Unused& unused : UnusedRows()) {
      if (IsBehind(shard, unused.table)) continue;
      (report_.*CountOf(unused)) += RemoveUnused(shard, unused);
    }
    RemoveVocabularies(shard, "words");
  }

  static std::uint64_t PurgeReport::*CountOf(const Unused& unused) {
    if (unused.table == "originals") return &PurgeReport::originals;
    const bool described = unused.table == "features" || unused.table == "words";
    return described ? &PurgeReport::descriptions : &PurgeReport::places;
  }

  void RemoveCollections(std::size_t shard) {
    const std::string gone = GoneCollections(may_);
    const NativeBlock rows =
        cluster_.link.Read(shard, "SELECT toUInt64(count()) AS states FROM pictures WHERE " + gone,
                           {{"states", "UInt64"}});
    if (rows.rows == 0 || Row(rows, 0).Number(0) == 0) return;
    report_.states += Row(rows, 0).Number(0);
    cluster_.link.Command(shard, "ALTER TABLE pictures DELETE WHERE " + gone);
  }

  // What says that something is gone must outlive what it hides, on every replica.
  std::uint64_t RemoveLast(std::size_t shard, const std::string& table,
                           const std::string& statement) {
    const auto replicas = cluster_.link.ReadReplicas(shard, statement, {{"value", "String"}});
    if (!replicas) {
      report_.all_replicas = false;
      return 0;
    }
    std::vector<std::string> all;
    for (std::size_t i = 0; i < replicas->size(); ++i) {
      std::vector<std::string> here = ListOf((*replicas)[i]);
      std::sort(here.begin(), here.end());
      if (i == 0) {
        all = std::move(here);
        continue;
      }
      std::vector<std::string> both;
      std::set_intersection(all.begin(), all.end(), here.begin(), here.end(),
                            std::back_inserter(both));
      all = std::move(both);
    }
    return Remove(shard, table, "version", all);
  }

  // Rows that no state has, but a writer may be about to give one: so under the lock for writing it
  // is looked once more, at states that are newer.
  std::uint64_t RemoveUnused(std::size_t shard, const Unused& unused) {
    const std::vector<std::string> values = ReadList(cluster_.link, shard, unused.List(may_));
    std::uint64_t removed = 0;
    for (std::size_t from = 0; from < values.size(); from += kValuesAStatement) {
      const std::size_t to = std::min(values.size(), from + kValuesAStatement);
      std::vector<std::string> some(values.data() + from, values.data() + to);
      cluster_.commits.RunAtOpening(
          [&](Change&) {
            const std::vector<std::string> used =
                ReadList(cluster_.link, shard, unused.NewerOf(may_, Joined(some)));
            std::erase_if(some, [&](const std::string& value) {
              return std::find(used.begin(), used.end(), value) != used.end();
            });
            removed += Remove(shard, unused.table, unused.key, some);
          },
          /*alone=*/true);
    }
    return removed;
  }

  void RemoveVocabularies(std::size_t shard, const std::string& table) {
    for (const std::string& key : ReadList(cluster_.link, shard, GoneVocabularies(may_, table))) {
      cluster_.link.Command(shard, "ALTER TABLE " + table + " DROP PARTITION " + key);
      ++report_.vocabularies;
    }
  }

  void RemoveCommon() {
    constexpr std::size_t kHome = ClusterLink::kHome;
    RemoveVocabularies(kHome, "vocabulary_words");
    if (!IsBehind(kHome, "registry")) {
      report_.registry += Remove(kHome, "registry", "version",
                                 ReadList(cluster_.link, kHome, ReplacedEntries(may_)));
      report_.registry += RemoveLast(kHome, "registry", LastRemovedEntries(may_));
    }
    if (may_.limits.log > 0 && !IsBehind(kHome, "log")) {
      const std::string old = "version <= " + std::to_string(may_.limits.log);
      const NativeBlock rows = cluster_.link.Read(
          kHome, "SELECT toUInt64(count()) AS rows FROM log WHERE " + old, {{"rows", "UInt64"}});
      if (rows.rows == 0 || Row(rows, 0).Number(0) == 0) return;
      cluster_.link.Command(kHome, "ALTER TABLE log DELETE WHERE " + old);
    }
  }

  ClusterAccess& cluster_;
  const PurgeOptions& options_;
  MayGo may_;
  std::uint64_t announced_ = 0;
  PurgeReport report_;
};

}  // namespace

PurgeReport Purge(ClusterAccess& cluster, const PurgeOptions& options) {
  // One that was killed has it until its session ends.
  const auto until = std::chrono::steady_clock::now() + options.wait;
  auto alone = cluster.keeper->TryLease(kOnePurge, "");
  while (!alone) {
    if (std::chrono::steady_clock::now() > until) {
      throw Error(ErrorCode::kConflict, "purge_running",
                  "another purge of this cluster is running");
    }
    std::this_thread::sleep_for(kLookAgain);
    alone = cluster.keeper->TryLease(kOnePurge, "");
  }
  return Purger(&cluster, options).Run();
}

}  // namespace pliant::clickhouse
