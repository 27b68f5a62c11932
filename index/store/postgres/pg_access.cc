// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A database on PostgreSQL, which other processes use at the same time, on this machine and others.
#include <mutex>

#include "descriptor/base/error.h"
#include "descriptor/base/unix_time.h"
#include "index/store/database_url.h"
#include "index/store/postgres/pg_connection.h"
#include "index/store/postgres/pg_monitor.h"
#include "index/store/postgres/schema.h"
#include "index/store/refusals.h"
#include "index/store/sql/access.h"
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

class PgAccess : public Access {
 public:
  PgAccess(Address address, const StoreOptions& options, StorePart part)
      : address_(std::move(address)),
        part_(static_cast<int>(part)),
        lock_timeout_ms_(options.busy_timeout_ms),
        monitor_(&address_),
        primary_(PoolOf(PgConnection::Target::kPrimary)) {
    if (address_.reads_on_standby) standby_.emplace(PoolOf(PgConnection::Target::kAny));
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

  std::unique_ptr<ReadTransaction> BeginReading() override {
    if (!standby_) return std::make_unique<ReadTransaction>(&primary_);
    // What was committed when this began must be seen, wherever it is read.
    const std::int64_t wanted = Version();
    try {
      auto reading = std::make_unique<ReadTransaction>(&*standby_);
      const bool is_standby = static_cast<const PgConnection&>(reading->db()).IsStandby();
      if (!is_standby || CommitsOf(reading->db()) >= wanted) return reading;
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kUnavailable) throw;
    }
    return std::make_unique<ReadTransaction>(&primary_);
  }

  std::int64_t Version() override {
    const std::lock_guard lock(watch_mutex_);
    if (watch_ && watch_->IsGood()) {
      try {
        return CommitsOf(*watch_);
      } catch (const Error&) {
        if (watch_->IsGood()) throw;
      }
    }
    watch_ = nullptr;  // before it is made again
    watch_ = OpenReader(PgConnection::Target::kPrimary);
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

  std::jthread FollowOthers(const std::function<void()>& wake) override {
    return monitor_.OnCommit(wake);
  }

  std::optional<DatabaseServerRecord> ServerFigures() override {
    DatabaseServerRecord figures;
    figures.connections = primary_.connections() + (standby_ ? standby_->connections() : 0) +
                          (writes() ? 1 : 0) + 2;  // the monitor's and Version's
    figures.commit = Version();
    figures.connection_waits = primary_.waits() + (standby_ ? standby_->waits() : 0);
    const ReadTransaction reading(&primary_);
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
  std::unique_ptr<PgConnection> OpenReader(PgConnection::Target target) {
    return std::make_unique<PgConnection>(
        &address_, &monitor_.health(),
        PgConnection::Options{.target = target,
                              .lock_timeout_ms = lock_timeout_ms_,
                              .idle_in_transaction_ms = kReadingMs,
                              .part = part_,
                              .features = &features_});
  }
  ConnectionPool::Options PoolOf(PgConnection::Target target) {
    return {.open = [this, target] { return OpenReader(target); },
            .most_lent = kMostReaders,
            .most_idle = kMostIdle,
            .wait_ms = lock_timeout_ms_,
            .database = address_.shown};
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
  ConnectionPool primary_;
  std::optional<ConnectionPool> standby_;  // absent: all reads go to the primary
  std::mutex watch_mutex_;                 // guards watch_
  std::unique_ptr<PgConnection> watch_;
};

[[noreturn]] void ThrowNotThere(const Address& address) {
  throw Error(ErrorCode::kNotFound, "database_not_found",
              "the database " + address.shown +
                  " has no tables of Pliant; create them with `pliant db init`");
}

bool HasTables(Connection& db) {
  return db.Scalar("SELECT to_regclass('pliant') IS NOT NULL") != 0;
}

// Several processes may do this at once: the lock lasts to the end of the transaction.
void EnsureTables(PgConnection& db, const Address& address, const StoreOptions& options,
                  StorePart part) {
  if (!HasTables(db)) {
    if (!options.create || options.read_only) ThrowNotThere(address);
    db.Exec("BEGIN; SELECT pg_advisory_xact_lock(hashtext('pliant'))");
    if (!HasTables(db)) db.Exec(SchemaSql());
    db.Exec("COMMIT");
  }
  refusals::CheckSchemaVersion(address.shown, db.Scalar("SELECT version FROM pliant"));
  if (part == StorePart::kService || !options.model_of_new) return;
  if (db.Scalar("SELECT count(*) FROM models") != 0) return;
  if (!options.create || options.read_only) ThrowNotThere(address);
  const DescriptorInfo model = options.model_of_new();
  db.BeginWrite();
  if (db.Scalar("SELECT count(*) FROM models") == 0) InsertFirstRows(db, model);
  db.Commit();
}

}  // namespace
}  // namespace pliant::postgres

namespace pliant {

std::unique_ptr<Access> OpenServerAccess(const StoreOptions& options, StorePart part) {
  postgres::Address address = postgres::ParseAddress(options.database.string());
  {
    postgres::PgConnection db(&address, nullptr, {});
    postgres::EnsureTables(db, address, options, part);
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
  postgres::EnsureTables(db, address, options, StorePart::kService);
}

}  // namespace pliant
