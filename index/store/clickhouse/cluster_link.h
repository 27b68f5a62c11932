// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The shards of a cluster as a store uses them: every statement goes straight to a replica of the
// shard that it is for.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "index/store/clickhouse/http_pool.h"
#include "index/store/clickhouse/native_format.h"
#include "index/store/clickhouse/statements.h"

namespace pliant::clickhouse {

// Thread-safe. Connects when first used. Every function throws what HttpPool throws, and
//   kUnavailable "shard_unavailable": no server of a shard answers, or the URL names none,
//   kNotFound "database_not_found": nobody has made the tables,
//   kConflict "cluster_differs": they were made for other shards or another Pliant.
class ClusterLink {
 public:
  static constexpr std::size_t kHome = 0;  // the shard of what is common to all

  ClusterLink(DatabaseUrl url, std::string password);
  ~ClusterLink();

  const DatabaseUrl& url() const { return url_; }
  std::size_t shards();
  std::size_t ShardOf(std::uint32_t collection, std::string_view id);

  // "FROM pictures" reads the table of the database.
  NativeBlock Read(std::size_t shard, const std::string& statement,
                   const std::vector<TableColumn>& columns);
  // By shard.
  std::vector<NativeBlock> ReadEach(const std::string& statement,
                                    const std::vector<TableColumn>& columns);
  // Of each replica of the shard by itself. Nothing when one of them does not answer, or the URL
  // does not name it.
  std::optional<std::vector<NativeBlock>> ReadReplicas(std::size_t shard,
                                                       const std::string& statement,
                                                       const std::vector<TableColumn>& columns);
  // When this returns, so many replicas as the cluster's settings say have the rows; when it
  // throws, they may have.
  void Insert(std::size_t shard, const TableSpec& table, const NativeBlock& rows);
  // ALTER and the like, on one replica: the others follow.
  void Command(std::size_t shard, const std::string& statement);

 private:
  struct Shape;

  std::shared_ptr<Shape> Current();
  std::shared_ptr<Shape> Find() const;
  void Forget(const std::shared_ptr<Shape>& shape);
  template <typename Work>
  auto On(std::size_t shard, const Work& work);
  DatabaseRequest Request(const Shape& shape, std::string statement) const;
  HttpPoolOptions Options(std::vector<HostPort> hosts) const;

  const DatabaseUrl url_;
  const std::string password_;
  std::mutex mutex_;  // guards shape_; held while it is found
  std::shared_ptr<Shape> shape_;
};

}  // namespace pliant::clickhouse
