// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Puts the databases of the engine's tests on the cluster that PLIANT_TEST_CLUSTER names
// (clickhouse://HOSTS/NAME?keeper=...): for each file a database of its own, NAME_1, NAME_2, ...
#include <cstdlib>
#include <iostream>
#include <map>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "index/store/clickhouse/cluster.h"
#include "index/store/clickhouse/database_url.h"
#include "index/store/cluster_scheme.h"
#include "tests/unit/test_database.h"

namespace pliant::testing {
namespace {

class OnCluster : public ::testing::Environment {
 public:
  void SetUp() override {
    UseClusters();
    const char* url = std::getenv("PLIANT_TEST_CLUSTER");
    ASSERT_NE(url, nullptr) << "run this by tests/cluster/on_cluster.sh";
    database_for_file = [this, pattern = clickhouse::ParseDatabaseUrl(url)](
                            const std::filesystem::path& file) -> std::filesystem::path {
      const auto known = made_.find(file);
      if (known != made_.end()) return known->second;
      clickhouse::DatabaseUrl own = pattern;
      own.database += "_" + std::to_string(made_.size() + 1);
      clickhouse::Cluster(own, "").Init();
      return made_[file] = own.Text();
    };
  }
  void TearDown() override { database_for_file = nullptr; }

 private:
  std::map<std::filesystem::path, std::string> made_;
};

const auto* const environment = ::testing::AddGlobalTestEnvironment(new OnCluster);

}  // namespace
}  // namespace pliant::testing
