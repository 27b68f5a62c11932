// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/shard_states.h"

#include <algorithm>
#include <chrono>
#include <future>

#include "descriptor/base/error.h"
#include "index/store/clickhouse/query.h"
#include "index/store/clickhouse/rows.h"

namespace pliant::clickhouse {
namespace {

constexpr std::chrono::milliseconds kAnswersWithin{3000};

// What one server says; nothing: it does not answer. Without a Keeper it sees no replica at work.
std::optional<ShardState> ReadServer(ClusterLink& link, const HostPort& host) {
  const std::string here = "WHERE database = " + Literal(link.url().database);
  const std::string statement =
      "SELECT active, lag, queue, all_rows, all_bytes, parts FROM (SELECT 1 AS one, "
      "toUInt64(min(active_replicas)) AS active, toUInt64(max(absolute_delay)) AS lag, "
      "toUInt64(max(queue_size)) AS queue FROM system.replicas " +
      here +
      ") ANY LEFT JOIN (SELECT 1 AS one, toUInt64(sum(rows)) AS all_rows, "
      "toUInt64(sum(bytes_on_disk)) AS all_bytes, toUInt64(count()) AS parts FROM system.parts " +
      here + " AND active) USING one";
  try {
    const NativeBlock rows = link.ReadServer(host, statement,
                                             {{"active", "UInt64"},
                                              {"lag", "UInt64"},
                                              {"queue", "UInt64"},
                                              {"all_rows", "UInt64"},
                                              {"all_bytes", "UInt64"},
                                              {"parts", "UInt64"}},
                                             kAnswersWithin, {});
    if (rows.rows != 1) return std::nullopt;
    const Row row(rows, 0);
    return ShardState{row.Number(0), row.Number(1), row.Number(2),
                      row.Number(3), row.Number(4), row.Number(5)};
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kUnavailable) throw;
    return std::nullopt;
  }
}

void Take(const ShardState& replica, std::optional<ShardState>& shard) {
  if (!shard) {
    shard = replica;
    return;
  }
  // One that has lost its Keeper sees nobody.
  shard->active_replicas = std::max(shard->active_replicas, replica.active_replicas);
  shard->lag_s = std::max(shard->lag_s, replica.lag_s);
  shard->queue = std::max(shard->queue, replica.queue);
  shard->rows = std::max(shard->rows, replica.rows);
  shard->bytes = std::max(shard->bytes, replica.bytes);
  shard->parts = std::max(shard->parts, replica.parts);
}

}  // namespace

std::vector<ShardRecord> ReadShardRecords(ClusterLink& link) {
  const std::vector<std::vector<HostPort>> hosts = link.Hosts();
  std::vector<std::vector<std::future<std::optional<ShardState>>>> asked(hosts.size());
  for (std::size_t shard = 0; shard < hosts.size(); ++shard) {
    for (const HostPort& host : hosts[shard]) {
      asked[shard].push_back(
          std::async(std::launch::async, [&link, host] { return ReadServer(link, host); }));
    }
  }
  std::vector<ShardRecord> records;
  for (std::size_t shard = 0; shard < hosts.size(); ++shard) {
    ShardRecord record;
    record.number = shard + 1;
    record.replicas = hosts[shard].size();
    for (auto& server : asked[shard]) {
      if (const auto state = server.get()) {
        ++record.answering;
        Take(*state, record.state);
      }
    }
    if (record.answering == 0) link.IsGone(shard);
    records.push_back(record);
  }
  return records;
}

}  // namespace pliant::clickhouse
