// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One connection to PostgreSQL with its prepared statements; all values travel in binary. Private
// to store/postgres. Used by one thread at a time; throws Error.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <libpq-fe.h>

#include "index/store/sql/connection.h"

namespace pliant::postgres {

// A database's URL, as libpq understands it (PostgreSQL's manual, "Connection URIs"), with its
// environment variables and files.
struct Address {
  std::string url;
  std::string shown;  // for people: hosts, database, schema; no user's secrets
  // Whether a standby that has all commits can serve reads: target_session_attrs of the URL is any,
  // read-only, standby or prefer-standby.
  bool reads_on_standby = false;
};

// Throws kInvalidArgument "database_url_invalid" for text that libpq does not understand. The
// message contains no part of the URL that can be a password.
Address ParseAddress(const std::string& url);

// PostgreSQL's errors as Pliant's. Private to store/postgres.

// Throws the Error for a failed result, by its SQLSTATE. `database` is its name for people.
[[noreturn]] void ThrowFailed(const PGresult* result, const std::string& database);
// No connection, or a broken one: kUnavailable "database_unavailable", or the server's reason (no
// such database, password).
[[noreturn]] void ThrowNotConnected(PGconn* connection, const std::string& database);
// The server does not answer.
[[noreturn]] void ThrowSilent(const std::string& database);
// The connection broke during a commit: kUnavailable "database_outcome_unknown".
[[noreturn]] void ThrowOutcomeUnknown(const std::string& database);

struct ResultDeleter {
  void operator()(PGresult* result) const { PQclear(result); }
};
using Result = std::unique_ptr<PGresult, ResultDeleter>;

// Whether the database's server is reachable, by PgMonitor. Thread-safe.
struct Health {
  // Number of times that the monitor lost its connection. An older connection can lead to a server
  // that has stopped, or that is no longer the primary.
  std::atomic<std::uint64_t> losses = 0;
  std::atomic<std::int64_t> answered_ms = 0;  // when it last answered (SteadyMs)
};
std::int64_t SteadyMs();

class PgConnection : public Connection {
 public:
  enum class Target { kPrimary, kAny };
  struct Options {
    Target target = Target::kPrimary;
    int lock_timeout_ms = 10'000;
    // The server ends the session when a transaction is idle for this time, because others can wait
    // for its locks. This happens when a program is stopped (SIGSTOP).
    int idle_in_transaction_ms = 15'000;
    std::string settings = {};  // further statements at the start of a session
    int part = 0;               // StorePart, of BeginWrite
    FeatureCache* features = nullptr;
  };

  // `health`: nullptr = waits end after 8 seconds. Both must outlive the connection.
  PgConnection(const Address* address, const Health* health, Options options);
  ~PgConnection() override;

  void Exec(const std::string& sql) override;
  void BeginRead() override;
  // Waits for this writer's turn among all processes, and counts the commit in `feed`.
  void BeginWrite() override;
  // Throws kUnavailable "database_outcome_unknown".
  void Commit() override;
  void Rollback() noexcept override;
  bool InTransaction() const override;
  bool KeepsItsTurn() const override { return false; }
  FeatureCache* feature_cache() override { return options_.features; }
  std::uint64_t epoch() const override { return losses_; }

  std::string IsAmong(const std::string& expression, const std::string& parameter) const override;
  std::string Passes(Query& query, const std::string& table, const Filter& filter) const override;
  std::string MetadataOf(const std::string& table) const override { return table + ".fields"; }
  std::vector<Facet> CountFacets(const Query& listed,
                                 const std::vector<std::string>& keys) override;
  std::string Contains(Query& query, const std::string& text,
                       const std::vector<std::string>& columns) const override;

  std::string NaturalKeyOf(const std::string& text) const override;
  std::string MetadataOrderOf(Query& query, const std::string& table,
                              const std::string& key) const override;

  bool IsStandby() const;
  // Connected, and the monitor has not lost the server since.
  bool IsGood() const override;
  // Waits for a message of another session (NOTIFY), at most for the given time. Returns whether
  // there was one.
  bool WaitForNotice(std::chrono::milliseconds time);

  // For its statements.
  void PrepareNamed(const std::string& name, const std::string& sql, std::span<const Oid> types);
  Result RunNamed(const std::string& name, std::span<const char* const> values,
                  std::span<const int> lengths, std::span<const int> formats);
  std::string NewName() { return "s" + std::to_string(++names_); }
  std::uint64_t session() const { return session_; }

 protected:
  std::unique_ptr<Statement> Make(const std::string& sql, bool kept) override;
  void ThrowRowMissing() override;

 private:
  void Connect();
  void Begin(const std::string& sql);
  Result Await();
  bool WaitForSocket(std::chrono::milliseconds time, bool writing = false) const;

  const Address& address_;
  const Health* health_;
  const Options options_;
  PGconn* connection_ = nullptr;
  std::uint64_t session_ = 0;  // counts Connect
  std::uint64_t losses_ = 0;   // Health::losses at the last Connect
  std::uint64_t names_ = 0;
};

}  // namespace pliant::postgres
