// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/snapshot.h"

#include <algorithm>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "index/store/clickhouse/rows.h"

namespace pliant::clickhouse {
Snapshots::Versions Snapshots::ReadVersions() {
  std::uint64_t known = 0;
  {
    const std::lock_guard lock(mutex_);
    known = known_log_;
  }
  // From what is known on: the rest of the log need not be read.
  const NativeBlock rows = link_.Read(
      ClusterLink::kHome,
      "SELECT max(version) AS newest, maxIf(version, collection = 0) AS common FROM log WHERE "
      "version >= " +
          std::to_string(known),
      {{"newest", "UInt64"}, {"common", "UInt64"}});
  Versions versions;
  if (rows.rows > 0) versions = {Row(rows, 0).Number(0), Row(rows, 0).Number(1)};
  const std::lock_guard lock(mutex_);
  if (versions.log < known) {
    // What a failed insert has left on one replica alone. To go back would be to forget it there,
    // and to load it twice later.
    throw Error(ErrorCode::kUnavailable, "replica_behind",
                "the replica that answered has not got yet what another one showed; try again");
  }
  known_log_ = std::max(known_log_, versions.log);
  known_common_ = versions.common = std::max(known_common_, versions.common);
  return versions;
}

std::uint64_t Snapshots::Version() { return ReadVersions().log; }

Snapshot Snapshots::Now() {
  const Versions versions = ReadVersions();
  {
    const std::lock_guard lock(mutex_);
    if (registry_ && registry_->version >= versions.common) return {versions.log, registry_};
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
  return {versions.log, std::move(registry)};
}

}  // namespace pliant::clickhouse
