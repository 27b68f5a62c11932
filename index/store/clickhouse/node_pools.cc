// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/node_pools.h"

#include <algorithm>
#include <chrono>

#include "descriptor/base/error.h"
#include "index/store/clickhouse/query.h"

namespace pliant::clickhouse {
namespace {

constexpr std::chrono::seconds kAnswersWithin{3};
constexpr const char* kNobody = "pliant_is_this_you";

NativeBlock Select(HttpPool& pool, const std::string& statement,
                   const std::vector<TableColumn>& types) {
  DatabaseRequest request;
  request.statement = statement;
  request.settings = {{"connect_timeout_with_failover_ms", "1000"}};
  request.repeatable = true;
  request.timeout = kAnswersWithin;
  return ReadRows(pool, request, types);
}

// Whether the server behind `pool` has that address. One reads its own tables without logging in,
// so a user that is nobody can read them there only.
bool IsItself(HttpPool& pool, const HostPort& address) {
  try {
    return Select(pool,
                  "SELECT dummy AS nothing FROM remote(" + Literal(address.Text()) +
                      ", system, one, " + Literal(kNobody) + ")",
                  {{"nothing", "UInt8"}})
               .rows == 1;
  } catch (const Error&) {
    return false;
  }
}

}  // namespace

NodePools::NodePools(const DatabaseUrl& url, const std::string& password)
    : url_(url), password_(password) {}

HttpPool* NodePools::Of(const NodeState& node) const {
  const auto found = pools_.find({node.shard, node.replica});
  return found == pools_.end() ? nullptr : found->second.get();
}

bool NodePools::Knows(const std::vector<NodeState>& nodes) const {
  return std::all_of(nodes.begin(), nodes.end(),
                     [this](const NodeState& node) { return Of(node) != nullptr; });
}

void NodePools::Find(const std::vector<NodeState>& nodes) {
  std::vector<HostPort> hosts = url_.hosts;
  for (const NodeState& node : nodes) {
    const HostPort guess{node.address.host, url_.hosts[0].port};
    if (std::find(hosts.begin(), hosts.end(), guess) == hosts.end()) hosts.push_back(guess);
  }
  for (const HostPort& host : hosts) {
    if (Knows(nodes)) return;
    Ask(host);
  }
}

void NodePools::Ask(const HostPort& host) {
  auto pool = std::make_unique<HttpPool>(HttpPoolOptions{.hosts = {host},
                                                         .tls = url_.tls,
                                                         .ca_file = url_.ca_file,
                                                         .user = url_.user,
                                                         .password = password_});
  NativeBlock rows;
  try {
    rows = Select(
        *pool,
        "SELECT toUInt64(shard_num) AS shard, toUInt64(replica_num) AS replica, "
        "host_name AS host, toUInt64(port) AS port FROM system.clusters WHERE is_local "
        "AND cluster = " +
            Literal(url_.cluster),
        {{"shard", "UInt64"}, {"replica", "UInt64"}, {"host", "String"}, {"port", "UInt64"}});
  } catch (const Error&) {
    return;  // it is missed where its node is read
  }
  // In 18.16 all replicas of its shard are called local.
  for (std::size_t i = 0; i < rows.rows; ++i) {
    const HostPort address{rows.columns[2].Of<std::string>()[i],
                           static_cast<int>(rows.columns[3].Of<std::uint64_t>()[i])};
    if (rows.rows > 1 && !IsItself(*pool, address)) continue;
    pools_.emplace(
        Place{rows.columns[0].Of<std::uint64_t>()[i], rows.columns[1].Of<std::uint64_t>()[i]},
        std::move(pool));
    return;
  }
}

}  // namespace pliant::clickhouse
