// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/cluster_scheme.h"

#include "descriptor/base/error.h"

namespace pliant {
namespace {

ClusterOpener& Opener() {
  static ClusterOpener opener;
  return opener;
}

}  // namespace

bool IsClusterUrl(std::string_view database) {
  return database.starts_with("clickhouse://") || database.starts_with("clickhouses://");
}

std::filesystem::path FolderOf(const std::filesystem::path& database) {
  if (IsClusterUrl(database.string())) return std::filesystem::temp_directory_path();
  return std::filesystem::absolute(database).parent_path();
}

void SetClusterOpener(const ClusterOpener& opener) { Opener() = opener; }

const ClusterOpener& RequireClusterOpener() {
  if (Opener().store != nullptr) return Opener();
  throw Error(
      ErrorCode::kInvalidArgument, "cluster_unsupported",
      "this program was built without ClickHouse (PLIANT_CLICKHOUSE); name a database file");
}

}  // namespace pliant
