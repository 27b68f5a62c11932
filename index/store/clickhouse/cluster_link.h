// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The shards of a cluster as a store uses them: every statement goes straight to a replica of the
// shard that it is for.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "index/store/clickhouse/http_pool.h"
#include "index/store/clickhouse/native_format.h"
#include "index/store/clickhouse/shard_finder.h"
#include "index/store/clickhouse/statements.h"

namespace pliant::clickhouse {

// Thread-safe. Connects when first used. Every function throws what HttpPool throws, and
//   kUnavailable "shard_unavailable": no server of a shard answers, or the URL names none,
//   kNotFound "database_not_found": nobody has made the tables,
//   kConflict "cluster_differs": they were made for other shards or another Pliant.
class ClusterLink {
 public:
  static constexpr std::size_t kHome = 0;  // the shard of what is common to all

  // `partial`: shards of which no server answers when it connects are Gone(), and no error.
  ClusterLink(DatabaseUrl url, std::string password, bool partial = false);
  ~ClusterLink();

  const DatabaseUrl& url() const { return url_; }
  bool partial() const { return partial_; }
  std::size_t shards();
  std::size_t ShardOf(std::uint32_t collection, std::string_view id);
  std::size_t replicas();  // of the shard with the fewest
  // Of each shard, the servers that the URL names.
  std::vector<std::vector<HostPort>> Hosts();

  // Shards that did not answer when they were last asked. Asks nobody itself: where one does not
  // answer, a thread looks once a second whether it is back.
  std::vector<std::size_t> Gone();
  // All but these.
  std::vector<std::size_t> Answering();
  // Somebody has asked each of its servers, and none answers.
  void IsGone(std::size_t shard);

  // "FROM pictures" reads the table of the database.
  NativeBlock Read(std::size_t shard, const std::string& statement,
                   const std::vector<TableColumn>& columns);
  // By shard.
  std::vector<NativeBlock> ReadEach(const std::string& statement,
                                    const std::vector<TableColumn>& columns);
  // In the order of `which`, at the same time.
  std::vector<NativeBlock> ReadEach(const std::vector<std::size_t>& which,
                                    const std::string& statement,
                                    const std::vector<TableColumn>& columns);
  // Of each replica of the shard by itself. Nothing when one of them does not answer, or the URL
  // does not name it.
  std::optional<std::vector<NativeBlock>> ReadReplicas(std::size_t shard,
                                                       const std::string& statement,
                                                       const std::vector<TableColumn>& columns);
  // One server by itself; `timeout` for its answer.
  NativeBlock ReadServer(const HostPort& host, const std::string& statement,
                         const std::vector<TableColumn>& columns, std::chrono::milliseconds timeout,
                         const std::stop_token& stop);
  // Asks the cluster how many replicas must have what is inserted from now on: for who holds the
  // lock for writing, under which alone it changes (cluster_quorum.h).
  void FollowQuorum();
  // When this returns, so many replicas have the rows; when it throws, they may have.
  void Insert(std::size_t shard, const TableSpec& table, const NativeBlock& rows);
  // A row of the table `settings`, which all nodes get; one has it when this returns.
  void InsertSetting(const NativeBlock& row);
  // ALTER and the like, on one replica: the others follow.
  void Command(std::size_t shard, const std::string& statement);

 private:
  struct Place;
  struct Shape;

  std::shared_ptr<const Shape> Current();
  std::shared_ptr<const Shape> ToShape(const FoundShards& found);
  void LookAgain();
  void Watch(const std::stop_token& stop);
  template <typename Work>
  auto On(std::size_t shard, bool reads, const Work& work);
  DatabaseRequest Request(const Shape& shape, std::string statement) const;
  void InsertInto(std::size_t shard, const TableSpec& table, const NativeBlock& rows,
                  const std::string& quorum);

  const DatabaseUrl url_;
  const bool partial_;
  std::atomic<std::size_t> quorum_{0};  // as chosen; 0 = nothing is
  ShardFinder finder_;                  // for whoever connects first, then for the watch's thread
  std::mutex mutex_;  // guards what follows; held while the shards are found for the first time
  std::condition_variable_any changed_;
  std::shared_ptr<const Shape> shape_;
  bool look_again_ = false;
  std::jthread watch_;  // runs once somebody has not answered
};

}  // namespace pliant::clickhouse
