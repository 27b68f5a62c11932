// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A database on PostgreSQL, which other processes use at the same time, on this machine and others.
#include <algorithm>
#include <condition_variable>
#include <mutex>

#include "descriptor/base/error.h"
#include "descriptor/base/unix_time.h"
#include "index/store/database_url.h"
#include "index/store/postgres/pg_connection.h"
#include "index/store/postgres/pg_monitor.h"
#include "index/store/postgres/schema.h"
#include "index/store/refusals.h"
#include "index/store/sql/access.h"
#include "index/store/sql/feature_cache.h"
#include "index/store/sql/rows.h"

namespace pliant::postgres {
namespace {

constexpr std::size_t kMostReaders = 16;  // connections that read, to the primary or a standby
// A search reads some 30 images of 50 to 130 kB: as much as a network of 1 Gbit/s carries in 20
// ms.
constexpr std::size_t kCacheBytes = std::size_t{256} << 20;
constexpr std::size_t kMostIdle = 4;        // that are kept
constexpr int kReadingMs = 10 * 60 * 1000;  // a client may be slow to take what is read
constexpr std::int64_t kCommits = std::int64_t{1} << 48;  // more than a history ever has

// Reading connections for many threads. Thread-safe.
class PgPool {
 public:
  PgPool(const Address* address, const Health* health, PgConnection::Options options, int wait_ms)
      : address_(*address), health_(*health), options_(std::move(options)), wait_ms_(wait_ms) {}

  // Throws kUnavailable "database_busy" when none becomes free in time.
  std::unique_ptr<PgConnection> Borrow() {
    std::unique_lock lock(mutex_);
    if (lent_ >= kMostReaders) ++waits_;
    const bool free = changed_.wait_for(lock, std::chrono::milliseconds(wait_ms_),
                                        [&] { return lent_ < kMostReaders; });
    if (!free) {
      throw Error(ErrorCode::kUnavailable, "database_busy",
                  "all connections to the database " + address_.shown + " are in use; try again");
    }
    ++lent_;
    std::erase_if(idle_, [](const auto& connection) { return !connection->IsGood(); });
    if (!idle_.empty()) {
      auto connection = std::move(idle_.back());
      idle_.pop_back();
      return connection;
    }
    lock.unlock();
    try {
      return std::make_unique<PgConnection>(&address_, &health_, options_);
    } catch (...) {
      GiveBack(nullptr);
      throw;
    }
  }

  void GiveBack(std::unique_ptr<PgConnection> connection) noexcept {
    if (connection) connection->Rollback();
    const std::lock_guard lock(mutex_);
    --lent_;
    changed_.notify_one();
    if (connection && connection->IsGood() && idle_.size() < kMostIdle) {
      idle_.push_back(std::move(connection));
    }
  }

  std::size_t connections() const {
    const std::lock_guard lock(mutex_);
    return lent_ + idle_.size();
  }
  std::uint64_t waits() const {
    const std::lock_guard lock(mutex_);
    return waits_;
  }

 private:
  const Address& address_;
  const Health& health_;
  const PgConnection::Options options_;
  const int wait_ms_;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::size_t lent_ = 0;
  std::uint64_t waits_ = 0;
  std::vector<std::unique_ptr<PgConnection>> idle_;
};

class PgReading : public Access::Reading {
 public:
  explicit PgReading(PgPool* pool) : pool_(*pool), connection_(pool->Borrow()) {
    try {
      connection_->BeginRead();
    } catch (...) {
      pool_.GiveBack(std::move(connection_));
      throw;
    }
  }
  ~PgReading() override { pool_.GiveBack(std::move(connection_)); }
  PgConnection& db() override { return *connection_; }

 private:
  PgPool& pool_;
  std::unique_ptr<PgConnection> connection_;
};

class PgAccess : public Access {
 public:
  PgAccess(Address address, const StoreOptions& options, StorePart part)
      : address_(std::move(address)),
        part_(static_cast<int>(part)),
        lock_timeout_ms_(options.busy_timeout_ms),
        monitor_(&address_),
        primary_(&address_, &monitor_.health(), ReadingOptions(PgConnection::Target::kPrimary),
                 options.busy_timeout_ms) {
    if (address_.reads_on_standby) {
      standby_ = std::make_unique<PgPool>(&address_, &monitor_.health(),
                                          ReadingOptions(PgConnection::Target::kAny),
                                          options.busy_timeout_ms);
    }
  }

  const std::string& name() const override { return address_.shown; }
  // The same for all that use it, by whatever address; another one for a copy of it elsewhere.
  std::string Identity() override {
    return Read([](Connection& db) {
      return db
          .Prepare(
              "SELECT 'postgresql ' || system_identifier || '/' || current_database() || '/' || "
              "current_schema() FROM pg_control_system()")
          .One()
          .Text(0);
    });
  }

  std::unique_ptr<Reading> BeginReading() override {
    if (standby_ == nullptr) return std::make_unique<PgReading>(&primary_);
    // What was committed when this began must be seen, wherever it is read.
    const std::int64_t wanted = Version();
    try {
      auto reading = std::make_unique<PgReading>(standby_.get());
      if (!reading->db().IsStandby() || CommitsOf(reading->db()) >= wanted) return reading;
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kUnavailable) throw;
    }
    return std::make_unique<PgReading>(&primary_);
  }

  std::int64_t Version() override {
    const std::lock_guard lock(watch_mutex_);
    if (!watch_ || !watch_->IsGood()) {
      watch_.reset();
      watch_.emplace(&address_, &monitor_.health(), ReadingOptions(PgConnection::Target::kPrimary));
    }
    try {
      return CommitsOf(*watch_);
    } catch (const Error&) {
      if (watch_->IsGood()) throw;
      watch_.reset();
    }
    watch_.emplace(&address_, &monitor_.health(), ReadingOptions(PgConnection::Target::kPrimary));
    return CommitsOf(*watch_);
  }

  FeedPosition Position(Connection& db) override {
    Cursor row = db.Prepare(
        "SELECT (SELECT coalesce(max(key), 0) FROM images), removals, position, history, left_at "
        "FROM feed WHERE key = ?");
    row.Bind(part_).One();
    return {row.Int(0), row.Int(1), row.Int(2), row.Int(3), row.Int(4)};
  }

  std::uint64_t SizeBytes() override {
    return Read([](Connection& db) {
      return static_cast<std::uint64_t>(db.Scalar("SELECT pg_database_size(current_database())"));
    });
  }

  // Sequences that were left behind, as by a restore without them, would give keys that were used.
  bool CheckStructure(Connection& db, std::vector<std::string>* problems) override {
    for (const char* table : {"collections", "objects", "images", "vocabularies"}) {
      const std::string name = table;
      if (db.Scalar("SELECT coalesce(max(key), 0) > coalesce(pg_sequence_last_value("
                    "pg_get_serial_sequence('" +
                    name + "', 'key')), 0) FROM " + name) != 0) {
        problems->push_back("table " + name + ": keys that were used may be used again");
      }
    }
    return true;
  }

  void Backup(const std::filesystem::path& /*target*/, const std::stop_token& /*stop*/) override {
    throw Error(
        ErrorCode::kInvalidArgument, "database_file_needed",
        "PostgreSQL's own tools back up a database on a server (pg_basebackup, pg_dump), and "
        "`pliant db copy` copies it to a file");
  }

  std::jthread FollowOthers(std::function<void()> wake) override {
    return monitor_.OnCommit(std::move(wake));
  }

  std::optional<DatabaseServerRecord> ServerFigures() override {
    DatabaseServerRecord figures;
    figures.connections = primary_.connections() + (standby_ ? standby_->connections() : 0) +
                          (writes() ? 1 : 0) + 2;  // the monitor's and Version's
    figures.commit = Version();
    figures.connection_waits = primary_.waits() + (standby_ ? standby_->waits() : 0);
    PgReading reading(&primary_);
    Cursor row = reading.db().Prepare(
        // Of users without the right to see it (pg_monitor) there is none.
        "SELECT CAST(extract(epoch FROM max(coalesce(replay_lag, interval '0'))) AS float8) "
        "FROM pg_stat_replication WHERE state IS NOT NULL");
    if (row.Next() && !row.IsNull(0)) figures.replication_lag_s = row.Double(0);
    return figures;
  }

  const std::string& Owner() override { return monitor_.Owner(); }
  bool Lives(const std::string& owner) override {
    return Read([&](Connection& db) { return monitor_.Lives(db, owner); });
  }

 protected:
  std::unique_ptr<Connection> OpenWriter() override {
    return std::make_unique<PgConnection>(
        &address_, &monitor_.health(),
        PgConnection::Options{.lock_timeout_ms = lock_timeout_ms_, .part = part_});
  }

 private:
  PgConnection::Options ReadingOptions(PgConnection::Target target) {
    return {.target = target,
            .lock_timeout_ms = lock_timeout_ms_,
            .idle_in_transaction_ms = kReadingMs,
            .part = part_,
            .features = &features_};
  }
  // Greater after each commit; after a standby took the place of a primary, too, also where it had
  // received fewer.
  std::int64_t CommitsOf(Connection& db) const {
    Cursor row = db.Prepare("SELECT history * ?1 + position FROM feed WHERE key = ?2");
    return row.Bind(kCommits, part_).One().Int(0);
  }

  const Address address_;
  const int part_;
  const int lock_timeout_ms_;
  FeatureCache features_{kCacheBytes};
  PgMonitor monitor_;
  PgPool primary_;
  std::unique_ptr<PgPool> standby_;  // nullptr: all reads go to the primary
  std::mutex watch_mutex_;           // guards watch_
  std::optional<PgConnection> watch_;
};

[[noreturn]] void ThrowNotThere(const Address& address) {
  throw Error(
      ErrorCode::kNotFound, "database_not_found",
      "the database " + address.shown + " has no tables of Pliant; `pliant db init` makes them");
}

bool HasTables(Connection& db) {
  return db.Scalar("SELECT to_regclass('pliant') IS NOT NULL") != 0;
}

// Several processes may do this at once: the lock lasts to the end of the transaction.
void Settle(PgConnection& db, const Address& address, const StoreOptions& options, StorePart part) {
  if (!HasTables(db)) {
    if (!options.create || options.read_only) ThrowNotThere(address);
    db.Exec("BEGIN; SELECT pg_advisory_xact_lock(hashtext('pliant'))");
    if (!HasTables(db)) db.Exec(kSchema);
    db.Exec("COMMIT");
  }
  refusals::CheckSchemaVersion(address.shown, db.Scalar("SELECT version FROM pliant"));
  if (part == StorePart::kService || !options.model_of_new) return;
  if (db.Scalar("SELECT count(*) FROM models") != 0) return;
  if (!options.create || options.read_only) ThrowNotThere(address);
  const DescriptorInfo model = options.model_of_new();
  db.BeginWrite();
  if (db.Scalar("SELECT count(*) FROM models") == 0) {
    const Key key = db.Prepare(
                          "INSERT INTO models (name, model_id, kind, dim) VALUES (?, ?, ?, ?) "
                          "RETURNING key")
                        .Bind(model.name, model.model_id, static_cast<int>(model.kind), model.dim)
                        .One()
                        .Int(0);
    InsertCollection(db, kDefaultCollection, key);
  }
  db.Commit();
}

}  // namespace
}  // namespace pliant::postgres

namespace pliant {

std::unique_ptr<Access> OpenServerAccess(const StoreOptions& options, StorePart part) {
  postgres::Address address = postgres::ParseAddress(options.database.string());
  {
    postgres::PgConnection db(&address, nullptr, {});
    postgres::Settle(db, address, options, part);
  }
  return std::make_unique<postgres::PgAccess>(std::move(address), options, part);
}

void InitializeDatabase(const std::string& url) {
  if (!IsDatabaseUrl(url)) {
    throw Error(ErrorCode::kInvalidArgument, "database_url_needed",
                "only a database on a server (postgresql://...) is initialized; a database file is "
                "made when the first image is added");
  }
  StoreOptions options;
  options.database = url;
  postgres::Address address = postgres::ParseAddress(url);
  postgres::PgConnection db(&address, nullptr, {});
  postgres::Settle(db, address, options, StorePart::kService);
}

}  // namespace pliant
