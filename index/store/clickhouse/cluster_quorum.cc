// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/cluster_quorum.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <thread>

#include "descriptor/base/error.h"
#include "index/store/clickhouse/query.h"
#include "index/store/clickhouse/rows.h"
#include "index/store/clickhouse/shard_states.h"

namespace pliant::clickhouse {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kAnswersWithin{3000};
constexpr std::chrono::milliseconds kPause{200};
constexpr std::chrono::seconds kEverywhereWithin{30};
constexpr std::chrono::seconds kWaitForTurn{60};

struct Chosen {
  std::size_t quorum = 0;
  std::uint64_t version = 0;
};

std::string SelectChosen() {
  return "SELECT version, body FROM settings WHERE name = " + Literal(kQuorumSettings) +
         " ORDER BY version DESC LIMIT 1";
}

Chosen ToChosen(const NativeBlock& rows) {
  if (rows.rows == 0) return {};
  return {ReadQuorumText(Row(rows, 0).Text(1)), Row(rows, 0).Number(0)};
}

const std::vector<TableColumn> kChosenColumns = {{"version", "UInt64"}, {"body", "String"}};

// Whether `holds` of every server that the URL names and that answers; of one that does not
// `of_silent`.
bool OnAll(ClusterLink& link, bool of_silent, const std::function<bool(const HostPort&)>& holds) {
  for (const auto& hosts : link.Hosts()) {
    for (const HostPort& host : hosts) {
      try {
        if (!holds(host)) return false;
      } catch (const Error& error) {
        if (error.code() != ErrorCode::kUnavailable) throw;
        if (!of_silent) return false;
      }
    }
  }
  return true;
}

bool Await(Clock::time_point until, const std::function<bool()>& holds) {
  while (!holds()) {
    if (Clock::now() > until) return false;
    std::this_thread::sleep_for(kPause);
  }
  return true;
}

// Whether a server has fetched all that its replicas have, of all tables. Where nothing was ever
// written, pointer and index are 0; where the first rows are not in the queue yet, they are, too.
bool IsCaughtUp(ClusterLink& link, const HostPort& host) {
  const std::string here = "WHERE database = " + Literal(link.url().database);
  const NativeBlock rows = link.ReadServer(
      host,
      "SELECT toUInt64(count()) AS tables, toUInt64(countIf(is_readonly OR is_session_expired OR "
      "active_replicas < total_replicas OR inserts_in_queue > 0 OR (log_pointer <= log_max_index "
      "AND (log_max_index > 0 OR all_rows > 0)))) AS behind FROM (SELECT table, is_readonly, "
      "is_session_expired, active_replicas, total_replicas, inserts_in_queue, log_pointer, "
      "log_max_index FROM system.replicas " +
          here + ") ANY LEFT JOIN (SELECT table, sum(rows) AS all_rows FROM system.parts " + here +
          " AND active GROUP BY table) USING table",
      {{"tables", "UInt64"}, {"behind", "UInt64"}}, kAnswersWithin, {});
  return rows.rows == 1 && Row(rows, 0).Number(0) >= Tables().size() && Row(rows, 0).Number(1) == 0;
}

void RequireUsable(std::size_t chosen, std::size_t replicas) {
  const std::string has =
      "a shard has " + std::to_string(replicas) + (replicas == 1 ? " replica" : " replicas");
  if (chosen > replicas) {
    throw Error(ErrorCode::kInvalidArgument, "quorum_too_large",
                has + ": " + std::to_string(chosen) + " could never acknowledge a write");
  }
  if (chosen == 1 && replicas > 2) {
    throw Error(ErrorCode::kInvalidArgument, "quorum_too_small",
                has +
                    ": with one of them down two still acknowledge, and what one alone has would "
                    "be hidden from readers later; 1 is for shards of two");
  }
}

void Write(ClusterLink& link, const Chosen& chosen) {
  RowWriter row(Table("settings").columns);
  row.Add(std::string_view(kQuorumSettings), chosen.version, QuorumText(chosen.quorum));
  link.InsertSetting(row.block());
}

}  // namespace

QuorumReport ReadQuorum(ClusterAccess& cluster) {
  QuorumReport report;
  report.chosen =
      ToChosen(cluster.link.Read(ClusterLink::kHome, SelectChosen(), kChosenColumns)).quorum;
  report.replicas = cluster.link.replicas();
  report.acknowledge = WriteQuorum(report.replicas, report.chosen);
  report.shards = ReadShardRecords(cluster.link);
  return report;
}

QuorumReport SetQuorum(ClusterAccess& cluster, std::size_t chosen, Clock::duration wait) {
  ClusterLink& link = cluster.link;
  const std::size_t replicas = link.replicas();
  RequireUsable(chosen, replicas);
  const auto lease = cluster.keeper->Lock(kWriteLock, Clock::now() + kWaitForTurn);
  const Chosen before = ToChosen(link.Read(ClusterLink::kHome, SelectChosen(), kChosenColumns));
  if (WriteQuorum(replicas, chosen) > WriteQuorum(replicas, before.quorum) &&
      !Await(Clock::now() + wait, [&] {
        return OnAll(link, false, [&](const HostPort& host) { return IsCaughtUp(link, host); });
      })) {
    throw Error(ErrorCode::kUnavailable, "replica_behind",
                "some replica does not answer, or has not got yet what fewer have acknowledged: "
                "see cluster status, and try again when it has");
  }
  if (!lease->held()) {
    throw Error(ErrorCode::kUnavailable, "keeper_unavailable",
                "the lock for writing was lost meanwhile; nothing has changed: try again");
  }
  const Chosen after{chosen, std::max<std::uint64_t>(NowMs(), before.version + 1)};
  Write(link, after);
  const bool everywhere = Await(Clock::now() + kEverywhereWithin, [&] {
    return OnAll(link, true, [&](const HostPort& host) {
      return ToChosen(link.ReadServer(host, SelectChosen(), kChosenColumns, kAnswersWithin, {}))
                 .version >= after.version;
    });
  });
  if (!everywhere) {
    throw Error(ErrorCode::kUnavailable, "node_unavailable",
                "it is written, but does not reach all nodes: see cluster check, and try again");
  }
  return ReadQuorum(cluster);
}

}  // namespace pliant::clickhouse
