// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Stores on a cluster of ClickHouse and ZooKeeper.
#pragma once

#include <memory>
#include <string>

#include "index/store/clickhouse/cluster_commits.h"
#include "index/store/open_store.h"

namespace pliant::clickhouse {

// What both stores stand on.
struct ClusterAccess {
  // Throws kInvalidArgument "database_url_invalid".
  explicit ClusterAccess(const std::string& url);

  std::string password;
  ClusterLink link;
  Snapshots snapshots;
  std::shared_ptr<Keeper> keeper;
  ClusterCommits commits;
};

std::unique_ptr<Store> OpenClickhouseStore(const StoreOptions& options);
std::unique_ptr<ServiceStore> OpenClickhouseServiceStore(const std::string& url);

}  // namespace pliant::clickhouse
