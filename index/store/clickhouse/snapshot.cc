// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/snapshot.h"

#include <algorithm>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "index/store/clickhouse/rows.h"

namespace pliant::clickhouse {
namespace {

// Jobs and keys change all the time, and change nothing here.
constexpr const char* kKinds = "('model', 'collection', 'alias', 'vocabulary')";

}  // namespace

Snapshots::Versions Snapshots::ReadVersions() {
  std::uint64_t known = 0;
  {
    const std::lock_guard lock(mutex_);
    known = known_log_;
  }
  // From what is known on: the rest of the log need not be read.
  const NativeBlock rows =
      link_.Read(ClusterLink::kHome,
                 "SELECT toUInt8(0) AS kind, max(version) AS newest FROM log WHERE version >= " +
                     std::to_string(known) +
                     " UNION ALL SELECT toUInt8(1) AS kind, max(version) AS newest FROM registry "
                     "WHERE kind IN " +
                     kKinds,
                 {{"kind", "UInt8"}, {"newest", "UInt64"}});
  Versions versions;
  for (std::size_t i = 0; i < rows.rows; ++i) {
    const Row row(rows, i);
    (row.Number(0) == 0 ? versions.log : versions.registry) = row.Number(1);
  }
  const std::lock_guard lock(mutex_);
  if (versions.log < known) {
    // What a failed insert has left on one replica alone. To go back would be to forget it there,
    // and to load it twice later.
    throw Error(ErrorCode::kUnavailable, "replica_behind",
                "the replica that answered has not got yet what another one showed; try again");
  }
  known_log_ = std::max(known_log_, versions.log);
  return versions;
}

std::uint64_t Snapshots::Version() {
  const Versions versions = ReadVersions();
  return std::max(versions.log, versions.registry);
}

Snapshot Snapshots::Now() {
  const Versions versions = ReadVersions();
  {
    const std::lock_guard lock(mutex_);
    if (registry_ && registry_->version == versions.registry) return {versions.log, registry_};
  }
  const NativeBlock rows =
      link_.Read(ClusterLink::kHome,
                 "SELECT kind, name, max(version) AS newest, argMax(deleted, version) AS gone, "
                 "argMax(body, version) AS text FROM registry WHERE kind IN " +
                     std::string(kKinds) + " GROUP BY kind, name",
                 {{"kind", "String"},
                  {"name", "String"},
                  {"newest", "UInt64"},
                  {"gone", "UInt8"},
                  {"text", "String"}});
  auto registry = std::make_shared<Registry>();
  for (std::size_t i = 0; i < rows.rows; ++i) {
    const Row row(rows, i);
    registry->version = std::max(registry->version, row.Number(2));
    Apply({row.Text(0), row.Text(1), row.Number(3) != 0, row.Text(4)}, *registry);
  }
  const std::lock_guard lock(mutex_);
  if (!registry_ || registry_->version < registry->version) registry_ = registry;
  return {versions.log, std::move(registry)};
}

}  // namespace pliant::clickhouse
