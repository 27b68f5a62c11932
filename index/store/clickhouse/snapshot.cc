// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/snapshot.h"

#include <algorithm>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "index/store/clickhouse/query.h"
#include "index/store/clickhouse/rows.h"

namespace pliant::clickhouse {

std::optional<std::uint64_t> OpenSnapshots::Oldest() const {
  const std::lock_guard lock(mutex_);
  if (logs_.empty()) return std::nullopt;
  return *logs_.begin();
}

SnapshotHold::SnapshotHold(std::shared_ptr<OpenSnapshots> open, std::uint64_t log,
                           std::uint64_t guard)
    : open_(std::move(open)), log_(log), guard_(guard) {
  const std::lock_guard lock(open_->mutex_);
  open_->logs_.insert(log_);
}

SnapshotHold::~SnapshotHold() {
  const std::lock_guard lock(open_->mutex_);
  open_->logs_.erase(open_->logs_.find(log_));
}

void SnapshotHold::MoveTo(std::uint64_t log) {
  const std::lock_guard lock(open_->mutex_);
  open_->logs_.erase(open_->logs_.find(log_));
  open_->logs_.insert(log_ = log);
}

void Snapshots::SetGuard(std::function<std::uint64_t()> guard) { guard_ = std::move(guard); }

void Snapshots::RequireKept(const Snapshot& snapshot) {
  const std::uint64_t guard = Guard();
  if (guard != 0 && snapshot.hold->guard_ == guard) return;
  const NativeBlock rows =
      link_.Read(ClusterLink::kHome,
                 "SELECT max(version) AS newest FROM registry WHERE kind = " + Literal(kPurgeKind),
                 {{"newest", "UInt64"}});
  if (rows.rows > 0 && Row(rows, 0).Number(0) > snapshot.log) {
    throw Error(ErrorCode::kUnavailable, "snapshot_expired",
                "this took so long, without a Keeper, that what it reads may have been purged; try "
                "again");
  }
  snapshot.hold->guard_ = guard;
}

Snapshots::Versions Snapshots::ReadVersions() {
  std::uint64_t known = 0;
  {
    const std::lock_guard lock(mutex_);
    known = known_log_;
  }
  const auto read = [this](std::uint64_t from) {
    const NativeBlock rows =
        link_.Read(ClusterLink::kHome,
                   "SELECT max(version) AS newest, maxIf(version, collection = 0) AS common FROM "
                   "log WHERE version >= " +
                       std::to_string(from),
                   {{"newest", "UInt64"}, {"common", "UInt64"}});
    return rows.rows == 0 ? Versions{} : Versions{Row(rows, 0).Number(0), Row(rows, 0).Number(1)};
  };
  // From what is known on: the rest of the log need not be read.
  Versions versions = read(known);
  if (versions.log < known) {
    versions = read(0);
    versions.is_behind = versions.log < known;
    if (versions.is_behind) return versions;
  }
  const std::lock_guard lock(mutex_);
  known_log_ = std::max(known_log_, versions.log);
  known_common_ = versions.common = std::max(known_common_, versions.common);
  return versions;
}

std::uint64_t Snapshots::Version() { return ReadVersions().log; }

Snapshot Snapshots::Now() { return Take(/*for_writing=*/false); }

Snapshot Snapshots::NowForWriting() { return Take(/*for_writing=*/true); }

Snapshot Snapshots::LastKnown() {
  const std::lock_guard lock(mutex_);
  if (!registry_ || registry_->version < known_common_) {
    throw Error(ErrorCode::kUnavailable, "shard_unavailable",
                "shard 1, which has what is common to all, does not answer, and this process has "
                "not seen its last state");
  }
  return {known_log_, registry_, std::make_shared<SnapshotHold>(open_, known_log_, Guard())};
}

Snapshot Snapshots::Take(bool for_writing) {
  // Open before it is read, so that nobody misses it in between.
  const std::uint64_t guard = Guard();
  std::uint64_t known = 0;
  {
    const std::lock_guard lock(mutex_);
    known = known_log_;
  }
  auto hold = std::make_shared<SnapshotHold>(open_, known, guard);
  const Versions versions = ReadVersions();
  if (for_writing && versions.is_behind) {
    throw Error(ErrorCode::kUnavailable, "replica_behind",
                "the replica that answered has not got yet what another one showed; try again");
  }
  hold->MoveTo(versions.log);
  {
    const std::lock_guard lock(mutex_);
    if (registry_ && registry_->version >= versions.common) {
      return {versions.log, registry_, std::move(hold)};
    }
  }
  const NativeBlock rows =
      link_.Read(ClusterLink::kHome,
                 "SELECT kind, name, argMax(deleted, version) AS gone, "
                 "argMax(body, version) AS text FROM registry WHERE kind IN " +
                     std::string(kCommonKinds) + " GROUP BY kind, name",
                 {{"kind", "String"}, {"name", "String"}, {"gone", "UInt8"}, {"text", "String"}});
  auto registry = std::make_shared<Registry>();
  registry->version = versions.common;
  for (std::size_t i = 0; i < rows.rows; ++i) {
    const Row row(rows, i);
    Apply({row.Text(0), row.Text(1), row.Number(2) != 0, row.Text(3)}, *registry);
  }
  const std::lock_guard lock(mutex_);
  if (!registry_ || registry_->version < registry->version) registry_ = registry;
  return {versions.log, std::move(registry), std::move(hold)};
}

}  // namespace pliant::clickhouse
