// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Stores on a cluster of ClickHouse and ZooKeeper.
#pragma once

#include <memory>
#include <string>

#include "index/store/clickhouse/cluster_commits.h"
#include "index/store/clickhouse/reader_floor.h"
#include "index/store/open_store.h"

namespace pliant::clickhouse {

// What both stores stand on.
struct ClusterAccess {
  // Throws kInvalidArgument "database_url_invalid". The password is read from `password_file`, or
  // from the environment when that is empty.
  explicit ClusterAccess(const std::string& url, const std::string& password_file = {},
                         bool partial = false);

  std::string password;
  ClusterLink link;
  Snapshots snapshots;
  std::shared_ptr<Keeper> keeper;
  ClusterCommits commits;
  ReaderFloor readers;
};

std::unique_ptr<Store> OpenClickhouseStore(const StoreOptions& options);
std::unique_ptr<ServiceStore> OpenClickhouseServiceStore(const std::string& url);

}  // namespace pliant::clickhouse
