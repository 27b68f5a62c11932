// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/cluster_link.h"

#include <future>
#include <set>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/sha256.h"
#include "index/store/clickhouse/query.h"

namespace pliant::clickhouse {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kAskAgainAfter{10};  // servers that did not answer
constexpr std::chrono::milliseconds kProbeTimeout{5000};

// What a server says of itself, and the cluster's settings as it knows them.
struct Probe {
  bool answered = false;
  std::exception_ptr failure;
  std::string shard;  // the macro
  std::uint64_t shards = 0;
  std::uint64_t fewest_replicas = 0;
  std::string settings;
  bool has_tables = false;
};

NativeBlock Ask(HttpPool& pool, const std::string& statement,
                const std::vector<TableColumn>& columns) {
  DatabaseRequest request;
  request.statement = statement;
  request.repeatable = true;
  request.timeout = kProbeTimeout;
  return ReadRows(pool, request, columns);
}

Probe ProbeServer(HttpPoolOptions options, const DatabaseUrl& url) {
  Probe probe;
  try {
    HttpPool pool(std::move(options));
    const std::string cluster = "FROM system.clusters WHERE cluster = " + Literal(url.cluster);
    const NativeBlock self = Ask(
        pool,
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
    if (probe.has_tables) {
      const NativeBlock settings =
          Ask(pool,
              "SELECT body FROM " + url.database +
                  ".settings WHERE name = 'fixed' ORDER BY version DESC LIMIT 1",
              {{"body", "String"}});
      if (settings.rows > 0) probe.settings = settings.columns[0].Of<std::string>().at(0);
    }
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

struct ClusterLink::Shape {
  Settings settings;
  std::vector<std::unique_ptr<HttpPool>> shards;
  std::vector<std::vector<HostPort>> hosts;  // of each
  bool complete = true;                      // every server of the URL answered
  Clock::time_point found = Clock::now();
};

ClusterLink::ClusterLink(DatabaseUrl url, std::string password)
    : url_(std::move(url)), password_(std::move(password)) {}

ClusterLink::~ClusterLink() = default;

HttpPoolOptions ClusterLink::Options(std::vector<HostPort> hosts) const {
  return {.hosts = std::move(hosts),
          .tls = url_.tls,
          .ca_file = url_.ca_file,
          .user = url_.user,
          .password = password_};
}

std::shared_ptr<ClusterLink::Shape> ClusterLink::Find() const {
  std::vector<std::future<Probe>> probes;
  for (const HostPort& host : url_.hosts) {
    probes.push_back(std::async(std::launch::async,
                                [this, host] { return ProbeServer(Options({host}), url_); }));
  }
  auto shape = std::make_shared<Shape>();
  std::map<std::string, std::vector<HostPort>> hosts;  // by shard, in the order of their names
  std::exception_ptr failure;
  std::uint64_t shards = 0;
  for (std::size_t i = 0; i < probes.size(); ++i) {
    const Probe probe = probes[i].get();
    if (!probe.answered) {
      shape->complete = false;
      failure = probe.failure;
      continue;
    }
    CheckProbe(probe, url_);
    shards = probe.shards;
    shape->settings = FixedSettings(probe.fewest_replicas);
    hosts[probe.shard].push_back(url_.hosts[i]);
  }
  if (hosts.empty()) std::rethrow_exception(failure);
  if (hosts.size() != shards) {
    throw Error(ErrorCode::kUnavailable, "shard_unavailable",
                "of the cluster's " + std::to_string(shards) + " shards, servers of " +
                    std::to_string(hosts.size()) +
                    " answer; the URL must name at least one of each shard");
  }
  for (auto& [name, of_shard] : hosts) {
    shape->shards.push_back(std::make_unique<HttpPool>(Options(of_shard)));
    shape->hosts.push_back(std::move(of_shard));
  }
  return shape;
}

std::shared_ptr<ClusterLink::Shape> ClusterLink::Current() {
  const std::lock_guard lock(mutex_);
  const bool again =
      !shape_ || (!shape_->complete && Clock::now() - shape_->found > kAskAgainAfter);
  if (again) {
    try {
      shape_ = Find();
    } catch (const Error&) {
      if (!shape_) throw;
      shape_->found = Clock::now();  // what was known goes on being used
    }
  }
  return shape_;
}

void ClusterLink::Forget(const std::shared_ptr<Shape>& shape) {
  const std::lock_guard lock(mutex_);
  if (shape_ == shape) shape_.reset();
}

DatabaseRequest ClusterLink::Request(const Shape& shape, std::string statement) const {
  DatabaseRequest request;
  request.statement = std::move(statement);
  request.settings = shape.settings;
  request.settings.emplace_back("database", url_.database);
  request.settings.emplace_back("max_query_size", "67108864");
  request.settings.emplace_back("insert_quorum_timeout", "15000");  // ms
  // The same rows again are meant: what they were has been purged since, perhaps.
  request.settings.emplace_back("insert_deduplicate", "0");
  return request;
}

template <typename Work>
auto ClusterLink::On(std::size_t shard, const Work& work) {
  const std::shared_ptr<Shape> shape = Current();
  try {
    return work(*shape, *shape->shards.at(shard));
  } catch (const Error& error) {
    if (error.reason() == "database_unavailable" || error.reason() == "database_timeout") {
      Forget(shape);
      if (error.reason() == "database_unavailable") {
        throw Error(ErrorCode::kUnavailable, "shard_unavailable",
                    "shard " + std::to_string(shard + 1) + ": " + error.what());
      }
    }
    throw;
  }
}

std::size_t ClusterLink::shards() { return Current()->shards.size(); }

std::size_t ClusterLink::ShardOf(std::uint32_t collection, std::string_view id) {
  const std::string name = std::to_string(collection) + "/" + std::string(id);
  const std::string hash =
      Sha256Hex({reinterpret_cast<const std::uint8_t*>(name.data()), name.size()});
  return FromHex(hash.substr(0, 2)).value().at(0) % shards();
}

NativeBlock ClusterLink::Read(std::size_t shard, const std::string& statement,
                              const std::vector<TableColumn>& columns) {
  return On(shard, [&](const Shape& shape, HttpPool& pool) {
    DatabaseRequest request = Request(shape, statement);
    request.repeatable = true;
    return ReadRows(pool, std::move(request), columns);
  });
}

std::vector<NativeBlock> ClusterLink::ReadEach(const std::string& statement,
                                               const std::vector<TableColumn>& columns) {
  const std::size_t count = shards();
  std::vector<std::future<NativeBlock>> others;
  for (std::size_t shard = 1; shard < count; ++shard) {
    others.push_back(
        std::async(std::launch::async, [&, shard] { return Read(shard, statement, columns); }));
  }
  std::vector<NativeBlock> blocks;
  blocks.push_back(Read(0, statement, columns));
  for (auto& other : others) blocks.push_back(other.get());
  return blocks;
}

std::optional<std::vector<NativeBlock>> ClusterLink::ReadReplicas(
    std::size_t shard, const std::string& statement, const std::vector<TableColumn>& columns) {
  const NativeBlock counted =
      Read(shard,
           "SELECT toUInt64(max(total_replicas)) AS replicas FROM system.replicas WHERE database "
           "= " +
               Literal(url_.database),
           {{"replicas", "UInt64"}});
  const std::shared_ptr<Shape> shape = Current();
  const std::vector<HostPort>& hosts = shape->hosts.at(shard);
  if (counted.rows == 0 || counted.columns[0].Of<std::uint64_t>()[0] != hosts.size()) {
    return std::nullopt;
  }
  std::vector<NativeBlock> blocks;
  try {
    for (const HostPort& host : hosts) {
      HttpPool pool(Options({host}));
      DatabaseRequest request = Request(*shape, statement);
      request.repeatable = true;
      blocks.push_back(ReadRows(pool, std::move(request), columns));
    }
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kUnavailable) throw;
    return std::nullopt;
  }
  return blocks;
}

void ClusterLink::Insert(std::size_t shard, const TableSpec& table, const NativeBlock& rows) {
  if (rows.rows == 0) return;
  On(shard, [&](const Shape& shape, HttpPool& pool) {
    std::string columns;
    for (const TableColumn& column : table.columns) {
      columns += (columns.empty() ? "" : ", ") + column.name;
    }
    DatabaseRequest request =
        Request(shape, "INSERT INTO " + table.name + " (" + columns + ") FORMAT Native");
    request.rows = EncodeNative(rows);
    pool.Fetch(request);
    return 0;
  });
}

void ClusterLink::Command(std::size_t shard, const std::string& statement) {
  On(shard, [&](const Shape& shape, HttpPool& pool) {
    pool.Fetch(Request(shape, statement));
    return 0;
  });
}

}  // namespace pliant::clickhouse
