// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/shard_finder.h"

#include <chrono>
#include <exception>
#include <future>
#include <utility>

#include "descriptor/base/error.h"
#include "index/store/clickhouse/query.h"

namespace pliant::clickhouse {
namespace {

constexpr std::chrono::milliseconds kProbeTimeout{5000};

// What a server says of itself, and the cluster's settings as it knows them.
struct Probe {
  bool answered = false;
  std::exception_ptr failure;
  std::string shard;  // the macro
  std::uint64_t shards = 0;
  std::uint64_t fewest_replicas = 0;
  std::string settings;
  std::vector<std::string> names;  // of all shards; empty in a cluster that an older version made
  bool has_tables = false;
};

NativeBlock Ask(HttpPool& pool, const std::stop_token& stop, const std::string& statement,
                const std::vector<TableColumn>& columns) {
  DatabaseRequest request;
  request.statement = statement;
  request.repeatable = true;
  request.timeout = kProbeTimeout;
  request.stop = stop;
  return ReadRows(pool, request, columns);
}

void AskForSettings(HttpPool& pool, const std::stop_token& stop, const DatabaseUrl& url,
                    Probe& probe) {
  const NativeBlock rows = Ask(
      pool, stop,
      "SELECT name, argMax(body, version) AS text FROM " + url.database + ".settings GROUP BY name",
      {{"name", "String"}, {"text", "String"}});
  for (std::size_t i = 0; i < rows.rows; ++i) {
    const std::string& name = rows.columns[0].Of<std::string>().at(i);
    const std::string& body = rows.columns[1].Of<std::string>().at(i);
    if (name == kFixedSettings) probe.settings = body;
    if (name == kShardNames) probe.names = ReadShardNames(body);
  }
}

Probe ProbeServer(HttpPoolOptions options, const DatabaseUrl& url, const std::stop_token& stop) {
  Probe probe;
  try {
    HttpPool pool(std::move(options));
    const std::string cluster = "FROM system.clusters WHERE cluster = " + Literal(url.cluster);
    const NativeBlock self = Ask(
        pool, stop,
        "SELECT (SELECT any(substitution) FROM system.macros WHERE macro = 'shard') AS shard, "
        "toUInt64((SELECT count() FROM (SELECT DISTINCT shard_num " +
            cluster + "))) AS shards, toUInt64((SELECT min(n) FROM (SELECT count() AS n " +
            cluster +
            " GROUP BY shard_num))) AS replicas, toUInt64((SELECT count() FROM system.tables WHERE "
            "database = " +
            Literal(url.database) + " AND name = 'settings')) AS tables",
        {{"shard", "String"}, {"shards", "UInt64"}, {"replicas", "UInt64"}, {"tables", "UInt64"}});
    const auto number = [&self](std::size_t column) {
      return self.columns[column].Of<std::uint64_t>().at(0);
    };
    probe.shard = self.columns[0].Of<std::string>().at(0);
    probe.shards = number(1);
    probe.fewest_replicas = number(2);
    probe.has_tables = number(3) > 0;
    if (probe.has_tables) AskForSettings(pool, stop, url, probe);
    probe.answered = true;
  } catch (...) {
    probe.failure = std::current_exception();
  }
  return probe;
}

[[noreturn]] void ThrowNoTables(const DatabaseUrl& url) {
  throw Error(ErrorCode::kNotFound, "database_not_found",
              "the cluster has no database " + url.database +
                  " yet; make its tables with pliant cluster init");
}

void CheckProbe(const Probe& probe, const DatabaseUrl& url) {
  if (probe.shards == 0) {
    throw Error(ErrorCode::kNotFound, "cluster_unknown",
                "ClickHouse's configuration has no cluster " + url.cluster);
  }
  if (!probe.has_tables || probe.settings.empty()) ThrowNoTables(url);
  const std::string wanted = FixedSettingsText(probe.shards, probe.fewest_replicas);
  if (probe.settings == wanted) return;
  throw Error(ErrorCode::kConflict, "cluster_differs",
              "the cluster was made with the settings " + probe.settings +
                  ", and now has, or this Pliant needs, " + wanted);
}

}  // namespace

HttpPoolOptions ShardFinder::Options(std::vector<HostPort> hosts) const {
  return {.hosts = std::move(hosts),
          .tls = url_.tls,
          .ca_file = url_.ca_file,
          .user = url_.user,
          .password = password_};
}

FoundShards ShardFinder::Find(const std::stop_token& stop) {
  std::vector<std::future<Probe>> probes;
  for (const HostPort& host : url_.hosts) {
    probes.push_back(std::async(std::launch::async, [this, host, &stop] {
      return ProbeServer(Options({host}), url_, stop);
    }));
  }
  FoundShards found;
  std::map<std::string, std::size_t> answering;  // by shard
  std::exception_ptr failure;
  for (std::size_t i = 0; i < probes.size(); ++i) {
    const Probe probe = probes[i].get();
    if (!probe.answered) {
      found.complete = false;
      failure = probe.failure;
      continue;
    }
    CheckProbe(probe, url_);
    count_ = probe.shards;
    replicas_ = probe.fewest_replicas;
    shards_[url_.hosts[i].Text()] = probe.shard;
    names_.insert(probe.shard);
    names_.insert(probe.names.begin(), probe.names.end());
    ++answering[probe.shard];
  }
  if (shards_.empty()) std::rethrow_exception(failure);
  std::map<std::string, std::vector<HostPort>> hosts;
  for (const HostPort& host : url_.hosts) {
    if (const auto shard = shards_.find(host.Text()); shard != shards_.end()) {
      hosts[shard->second].push_back(host);
    }
  }
  if (names_.size() != count_ || (!partial_ && hosts.size() != count_)) {
    throw Error(ErrorCode::kUnavailable, "shard_unavailable",
                "of the cluster's " + std::to_string(count_) + " shards, servers of " +
                    std::to_string(hosts.size()) +
                    " answer; the URL must name at least one of each shard");
  }
  for (const std::string& name : names_) {
    found.shards.push_back({name, hosts[name], answering[name]});
  }
  found.replicas = replicas_;
  return found;
}

}  // namespace pliant::clickhouse
