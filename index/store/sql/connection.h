// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One connection to any SQL database: statements with numbered parameters (?, ?1, ?2, ...) in the
// SQL that all databases share, and the few expressions that differ. Private to index/store/. One
// thread uses a connection at a time. It throws its own database's exceptions or Error; Access
// throws only Error.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "descriptor/base/lru_cache.h"
#include "descriptor/image/image.h"
#include "index/records/filter.h"
#include "index/records/image_ref.h"
#include "index/records/listing.h"

namespace pliant {

// Binds as NULL when 0.
struct KeyOrNull {
  std::int64_t key = 0;
};

// A value for SQL functions of this process; `type` says what it is, as a constant.
struct SqlPointer {
  std::shared_ptr<const void> value;
  const char* type = nullptr;
};

// A prepared statement. Bound blobs are not copied: they must outlive the statement's run.
class Statement {
 public:
  virtual ~Statement() = default;

  virtual void Bind(int index, std::int64_t value) = 0;
  virtual void Bind(int index, double value) = 0;
  virtual void Bind(int index, const std::string& value) = 0;
  virtual void Bind(int index, Bytes value) = 0;
  virtual void Bind(int index, std::span<const Key> keys) = 0;  // for Connection::IsAmong
  virtual void BindNull(int index) = 0;
  virtual void Bind(int index, const SqlPointer& value) = 0;

  virtual bool Step() = 0;             // the next row; false = no further row
  virtual std::int64_t Changed() = 0;  // number of changed rows, after the run
  // Call it before the next run. Keeps the bound values.
  virtual void Reset() noexcept = 0;
  virtual void ClearBindings() noexcept = 0;

  virtual bool IsNull(int column) const = 0;
  virtual std::int64_t Int(int column) const = 0;  // true and false are 1 and 0
  virtual double Double(int column) const = 0;
  virtual std::string Text(int column) const = 0;
  virtual Bytes Blob(int column) const = 0;  // valid until the next step
};

class Connection;

// Candidate cache: encoded features of recently verified images, for databases on other machines.
// An image's key identifies one state of it, so that entries stay valid; but a database that lost
// commits can give their keys again, and begins a new epoch.
using FeatureCache = LruCache<std::pair<std::uint64_t /*epoch*/, Key>, std::vector<std::uint8_t>>;

using SqlValue = std::variant<std::int64_t, std::string, SqlPointer>;

// SQL built from pieces, with the values of its parameters.
struct Query {
  std::string sql;
  std::vector<SqlValue> values = {};

  // Binds the value. Returns its parameter as SQL text.
  template <typename Value>
  std::string Bind(Value value) {
    values.emplace_back(std::move(value));
    return "?" + std::to_string(values.size());
  }
};

// A borrowed prepared statement. The end of its scope resets and returns it, so that no read
// transaction outlives it.
class Cursor {
 public:
  // `sql`: the key in the owner's idle statements; nullptr = do not keep it.
  Cursor(Connection& owner, const std::string* sql, std::unique_ptr<Statement> statement)
      : owner_(&owner), sql_(sql), statement_(std::move(statement)) {}
  ~Cursor();
  Cursor(Cursor&&) = default;
  Cursor& operator=(Cursor&&) = delete;

  // Binds parameters 1, 2, ... in order.
  template <typename... Values>
  Cursor& Bind(const Values&... values) {
    int index = 0;
    (BindOne(++index, values), ...);
    return *this;
  }
  Cursor& Reset() {
    statement_->Reset();
    return *this;
  }
  bool Next() { return statement_->Step(); }
  std::int64_t Run() {  // returns the number of changed rows
    while (statement_->Step()) {
    }
    return statement_->Changed();
  }
  // Next() that must find a row.
  Cursor& One();

  bool IsNull(int column) const { return statement_->IsNull(column); }
  std::int64_t Int(int column) const { return statement_->Int(column); }
  std::uint64_t Count(int column) const { return static_cast<std::uint64_t>(Int(column)); }
  double Double(int column) const { return statement_->Double(column); }
  std::string Text(int column) const { return statement_->Text(column); }
  Bytes Blob(int column) const { return statement_->Blob(column); }
  std::vector<std::uint8_t> CopyOfBlob(int column) const {
    const Bytes bytes = Blob(column);
    return {bytes.begin(), bytes.end()};
  }

 private:
  friend class Connection;
  template <typename Value>
  void BindOne(int index, const Value& value) {
    if constexpr (std::is_same_v<Value, KeyOrNull>) {
      value.key != 0 ? statement_->Bind(index, value.key) : statement_->BindNull(index);
    } else if constexpr (std::is_integral_v<Value>) {
      statement_->Bind(index, static_cast<std::int64_t>(value));
    } else if constexpr (std::is_floating_point_v<Value>) {
      statement_->Bind(index, static_cast<double>(value));
    } else if constexpr (std::is_same_v<Value, std::vector<std::uint8_t>>) {
      statement_->Bind(index, Bytes(value));
    } else {
      statement_->Bind(index, value);
    }
  }
  void BindOne(int index, const SqlValue& value);

  Connection* owner_;
  const std::string* sql_;
  std::unique_ptr<Statement> statement_;
};

class Connection {
 public:
  virtual ~Connection() = default;

  Cursor Prepare(std::string_view sql);  // keeps the statement: use only a limited number of texts
  Cursor Prepare(const Query& query);
  // First column of the first row of a statement without parameters.
  std::int64_t Scalar(std::string_view sql) { return Prepare(sql).One().Int(0); }
  virtual void Exec(const std::string& sql) = 0;  // statements without parameters and results

  // Transactions. A reader sees one state. There is only one writer.
  virtual void BeginRead() = 0;
  virtual void BeginWrite() = 0;
  virtual void Commit() = 0;
  virtual void Rollback() noexcept = 0;  // any open transaction; ignores failures
  // Whether the transaction can continue after a failed statement, with ROLLBACK TO.
  virtual bool InTransaction() const = 0;

  // Whether a writing transaction stays the only one until this process ends it, or exits.
  // Otherwise the database can end it, and each further statement fails.
  virtual bool KeepsItsTurn() const = 0;

  // Whether it can be used again.
  virtual bool IsGood() const { return true; }

  // For databases that need one.
  virtual FeatureCache* feature_cache() { return nullptr; }
  virtual std::uint64_t epoch() const { return 0; }

  // The differences between databases, as SQL text. Whether `expression` is one of the keys bound
  // to `parameter`.
  virtual std::string IsAmong(const std::string& expression,
                              const std::string& parameter) const = 0;
  // Whether the metadata of image `table` pass the filter, which must outlive the query's run.
  virtual std::string Passes(Query& query, const std::string& table,
                             const Filter& filter) const = 0;
  // Counts values of metadata over a query with the columns `item` and `metadata` (as from
  // MetadataOf). A value counts once per item. The rows of an item are adjacent.
  virtual std::string MetadataOf(const std::string& table) const { return table + ".metadata"; }
  virtual std::vector<Facet> CountFacets(const Query& listed, const std::vector<std::string>& keys);
  // Whether each word of `text` occurs in one of the columns, in any case. The columns are names of
  // `images` (p) or `objects` (o).
  virtual std::string Contains(Query& query, const std::string& text,
                               const std::vector<std::string>& columns) const = 0;
  // NaturalKey (index/files/text.h) of a text, and MetadataOrder (records/filter.h) of `table`.
  virtual std::string NaturalKeyOf(const std::string& text) const = 0;
  virtual std::string MetadataOrderOf(Query& query, const std::string& table,
                                      const std::string& key) const = 0;

 protected:
  // `kept`: it will run again. Otherwise another one that is not kept can replace it after its run.
  virtual std::unique_ptr<Statement> Make(const std::string& sql, bool kept) = 0;
  virtual void ThrowRowMissing() = 0;  // for Cursor::One
  void ForgetStatements() { idle_.clear(); }

 private:
  friend class Cursor;
  using Idle = std::map<std::string, std::vector<std::unique_ptr<Statement>>, std::less<>>;
  Idle idle_;  // keys stay: a Cursor refers to one
};

// Connections that read, for many threads. Thread-safe.
class ConnectionPool {
 public:
  struct Options {
    std::function<std::unique_ptr<Connection>()> open;
    std::size_t most_lent = std::numeric_limits<std::size_t>::max();
    std::size_t most_idle = 16;  // kept idle connections
    int wait_ms = 0;             // for one of most_lent
    std::string database = {};   // its name for people
  };
  explicit ConnectionPool(Options options) : options_(std::move(options)) {
    idle_.reserve(options_.most_idle);  // so that GiveBack does not throw
  }

  // Throws kUnavailable "database_busy" when none becomes free in time.
  std::unique_ptr<Connection> Borrow();
  void GiveBack(std::unique_ptr<Connection> connection) noexcept;

  std::size_t connections() const {
    const std::lock_guard lock(mutex_);
    return lent_ + idle_.size();
  }
  std::uint64_t waits() const {  // number of waits for a free connection
    const std::lock_guard lock(mutex_);
    return waits_;
  }

 private:
  const Options options_;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::size_t lent_ = 0;
  std::uint64_t waits_ = 0;
  std::vector<std::unique_ptr<Connection>> idle_;
};

// A borrowed connection in a read transaction, for as long as it lives. Must not outlive the pool.
class ReadTransaction {
 public:
  explicit ReadTransaction(ConnectionPool* pool);
  ~ReadTransaction() { pool_.GiveBack(std::move(connection_)); }
  ReadTransaction(const ReadTransaction&) = delete;
  ReadTransaction& operator=(const ReadTransaction&) = delete;

  Connection& db() const { return *connection_; }

 private:
  ConnectionPool& pool_;
  std::unique_ptr<Connection> connection_;
};

}  // namespace pliant
