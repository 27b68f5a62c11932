// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/cluster_link.h"

#include <algorithm>
#include <exception>
#include <future>
#include <numeric>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/sha256.h"
#include "index/store/clickhouse/query.h"

namespace pliant::clickhouse {
namespace {

// Until servers that did not answer are asked again: while a whole shard is gone, and else.
constexpr std::chrono::seconds kWhileGone{1};
constexpr std::chrono::seconds kWhileIncomplete{10};
constexpr std::chrono::milliseconds kTimeoutWhileGone{5000};

}  // namespace

struct ClusterLink::Place {
  Place(FoundShard found, HttpPoolOptions options)
      : shard(std::move(found)), pool(std::move(options)) {}

  const FoundShard shard;
  HttpPool pool;
  std::atomic<bool> gone{false};
};

struct ClusterLink::Shape {
  std::size_t replicas = 0;
  Settings settings;
  std::vector<std::shared_ptr<Place>> shards;
  bool complete = true;  // every server of the URL answered

  bool some_gone() const {
    return std::any_of(shards.begin(), shards.end(),
                       [](const auto& place) { return place->gone.load(); });
  }
};

ClusterLink::ClusterLink(DatabaseUrl url, std::string password, bool partial)
    : url_(std::move(url)), partial_(partial), finder_(url_, std::move(password), partial) {}

ClusterLink::~ClusterLink() = default;

std::shared_ptr<const ClusterLink::Shape> ClusterLink::Current() {
  const std::lock_guard lock(mutex_);
  if (!shape_) {
    shape_ = ToShape(finder_.Find({}));
    if (!shape_->complete) LookAgain();
  }
  return shape_;
}

// Keeps the connections to shards whose servers are the same as before.
std::shared_ptr<const ClusterLink::Shape> ClusterLink::ToShape(const FoundShards& found) {
  auto shape = std::make_shared<Shape>();
  shape->replicas = found.replicas;
  shape->settings = FixedSettings(found.replicas);
  shape->complete = found.complete;
  for (const FoundShard& shard : found.shards) {
    const std::size_t number = shape->shards.size();
    std::shared_ptr<Place> place;
    if (shape_ && number < shape_->shards.size() &&
        shape_->shards[number]->shard.hosts == shard.hosts) {
      place = shape_->shards[number];
    } else {
      place = std::make_shared<Place>(shard, finder_.Options(shard.hosts));
    }
    place->gone = shard.answering == 0;
    shape->shards.push_back(std::move(place));
  }
  return shape;
}

// With mutex_ held.
void ClusterLink::LookAgain() {
  look_again_ = true;
  changed_.notify_all();
  if (!watch_.joinable()) {
    watch_ = std::jthread([this](const std::stop_token& stop) { Watch(stop); });
  }
}

void ClusterLink::Watch(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [this] { return look_again_; })) {
    look_again_ = false;
    // Not at once: who has just failed is given a moment, and so are all the others that fail.
    const auto pause = shape_->some_gone() ? kWhileGone : kWhileIncomplete;
    changed_.wait_for(lock, stop, pause, [this, pause] {
      return pause != kWhileGone && look_again_ && shape_->some_gone();
    });
    if (stop.stop_requested()) return;
    lock.unlock();
    std::optional<FoundShards> found;
    try {
      found = finder_.Find(stop);
    } catch (const std::exception&) {
      // What was known goes on being used; statements that fail say why.
    }
    lock.lock();
    if (found) shape_ = ToShape(*found);
    if (!found || !found->complete || shape_->some_gone()) look_again_ = true;
  }
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
auto ClusterLink::On(std::size_t shard, bool reads, const Work& work) {
  const std::shared_ptr<const Shape> shape = Current();
  Place& place = *shape->shards.at(shard);
  const auto refuse = [&](const std::string& why) {
    return Error(ErrorCode::kUnavailable, "shard_unavailable",
                 "shard " + std::to_string(shard + 1) + ": " + why);
  };
  if (place.shard.hosts.empty()) throw refuse("none of its servers has answered");
  try {
    auto result = work(*shape, place);
    if (reads) place.gone = false;
    return result;
  } catch (const Error& error) {
    if (error.reason() != "database_unavailable" && error.reason() != "database_timeout") throw;
    const bool was_gone = place.gone;
    // What refuses to be written may well be read.
    if (reads) place.gone = true;
    {
      const std::lock_guard lock(mutex_);
      LookAgain();
    }
    if (error.reason() == "database_unavailable" || was_gone) throw refuse(error.what());
    throw;
  }
}

std::size_t ClusterLink::shards() { return Current()->shards.size(); }

std::size_t ClusterLink::replicas() { return Current()->replicas; }

std::vector<std::vector<HostPort>> ClusterLink::Hosts() {
  std::vector<std::vector<HostPort>> hosts;
  for (const auto& place : Current()->shards) hosts.push_back(place->shard.hosts);
  return hosts;
}

std::size_t ClusterLink::ShardOf(std::uint32_t collection, std::string_view id) {
  const std::string name = std::to_string(collection) + "/" + std::string(id);
  const std::string hash =
      Sha256Hex({reinterpret_cast<const std::uint8_t*>(name.data()), name.size()});
  return FromHex(hash.substr(0, 2)).value().at(0) % shards();
}

std::vector<std::size_t> ClusterLink::Gone() {
  const std::shared_ptr<const Shape> shape = Current();
  std::vector<std::size_t> gone;
  for (std::size_t i = 0; i < shape->shards.size(); ++i) {
    if (shape->shards[i]->gone) gone.push_back(i);
  }
  return gone;
}

std::vector<std::size_t> ClusterLink::Answering() {
  const std::shared_ptr<const Shape> shape = Current();
  std::vector<std::size_t> answering;
  for (std::size_t i = 0; i < shape->shards.size(); ++i) {
    if (!shape->shards[i]->gone) answering.push_back(i);
  }
  return answering;
}

void ClusterLink::IsGone(std::size_t shard) {
  Current()->shards.at(shard)->gone = true;
  const std::lock_guard lock(mutex_);
  LookAgain();
}

NativeBlock ClusterLink::Read(std::size_t shard, const std::string& statement,
                              const std::vector<TableColumn>& columns) {
  return On(shard, /*reads=*/true, [&](const Shape& shape, Place& place) {
    DatabaseRequest request = Request(shape, statement);
    request.repeatable = true;
    if (place.gone) request.timeout = kTimeoutWhileGone;
    return ReadRows(place.pool, std::move(request), columns);
  });
}

std::vector<NativeBlock> ClusterLink::ReadEach(const std::string& statement,
                                               const std::vector<TableColumn>& columns) {
  std::vector<std::size_t> all(shards());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return ReadEach(all, statement, columns);
}

std::vector<NativeBlock> ClusterLink::ReadEach(const std::vector<std::size_t>& which,
                                               const std::string& statement,
                                               const std::vector<TableColumn>& columns) {
  if (which.empty()) return {};
  std::vector<std::future<NativeBlock>> others;
  for (std::size_t i = 1; i < which.size(); ++i) {
    others.push_back(std::async(std::launch::async,
                                [&, shard = which[i]] { return Read(shard, statement, columns); }));
  }
  std::vector<NativeBlock> blocks;
  blocks.push_back(Read(which[0], statement, columns));
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
  const std::shared_ptr<const Shape> shape = Current();
  const std::vector<HostPort>& hosts = shape->shards.at(shard)->shard.hosts;
  if (counted.rows == 0 || counted.columns[0].Of<std::uint64_t>()[0] != hosts.size()) {
    return std::nullopt;
  }
  std::vector<NativeBlock> blocks;
  try {
    for (const HostPort& host : hosts) {
      blocks.push_back(ReadServer(host, statement, columns, std::chrono::milliseconds(0), {}));
    }
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kUnavailable) throw;
    return std::nullopt;
  }
  return blocks;
}

NativeBlock ClusterLink::ReadServer(const HostPort& host, const std::string& statement,
                                    const std::vector<TableColumn>& columns,
                                    std::chrono::milliseconds timeout,
                                    const std::stop_token& stop) {
  HttpPool pool(finder_.Options({host}));
  DatabaseRequest request = Request(*Current(), statement);
  request.repeatable = true;
  request.timeout = timeout;
  request.stop = stop;
  return ReadRows(pool, std::move(request), columns);
}

void ClusterLink::FollowQuorum() {
  const NativeBlock rows =
      Read(kHome,
           "SELECT body FROM settings WHERE name = " + Literal(kQuorumSettings) +
               " ORDER BY version DESC LIMIT 1",
           {{"body", "String"}});
  quorum_ = rows.rows == 0 ? 0 : ReadQuorumText(rows.columns[0].Of<std::string>().at(0));
}

void ClusterLink::Insert(std::size_t shard, const TableSpec& table, const NativeBlock& rows) {
  if (rows.rows == 0) return;
  InsertInto(shard, table, rows, InsertQuorum(WriteQuorum(replicas(), quorum_)));
}

void ClusterLink::InsertSetting(const NativeBlock& row) {
  InsertInto(kHome, Table("settings"), row, InsertQuorum(1));
}

void ClusterLink::InsertInto(std::size_t shard, const TableSpec& table, const NativeBlock& rows,
                             const std::string& quorum) {
  On(shard, /*reads=*/false, [&](const Shape& shape, Place& place) {
    std::string columns;
    for (const TableColumn& column : table.columns) {
      columns += (columns.empty() ? "" : ", ") + column.name;
    }
    DatabaseRequest request =
        Request(shape, "INSERT INTO " + table.name + " (" + columns + ") FORMAT Native");
    request.rows = EncodeNative(rows);
    for (auto& [name, value] : request.settings) {
      if (name == "insert_quorum") value = quorum;
    }
    place.pool.Fetch(request);
    return 0;
  });
}

void ClusterLink::Command(std::size_t shard, const std::string& statement) {
  On(shard, /*reads=*/false, [&](const Shape& shape, Place& place) {
    place.pool.Fetch(Request(shape, statement));
    return 0;
  });
}

}  // namespace pliant::clickhouse
