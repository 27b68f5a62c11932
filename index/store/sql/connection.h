// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One connection to a database that speaks SQL, whichever it is: statements with numbered
// parameters (?, ?1, ?2, ...) in the SQL that all databases share, and the few words in
// which they differ. Private to index/store/. A connection is used by one thread at a time, and
// throws its own database's exceptions or Error; Access lets out only Error.
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

// A prepared statement. Blobs that are bound are not copied: they must outlive the statement's run.
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

  virtual bool Step() = 0;             // the next row; false: there is none
  virtual std::int64_t Changed() = 0;  // rows that it has changed, once it has run
  // Before it runs again. Clears nothing that is bound.
  virtual void Reset() noexcept = 0;
  virtual void ClearBindings() noexcept = 0;

  virtual bool IsNull(int column) const = 0;
  virtual std::int64_t Int(int column) const = 0;  // true and false are 1 and 0
  virtual double Double(int column) const = 0;
  virtual std::string Text(int column) const = 0;
  virtual Bytes Blob(int column) const = 0;  // valid until the next step
};

class Connection;
class FeatureCache;

using SqlValue = std::variant<std::int64_t, std::string, SqlPointer>;

// SQL that is put together from pieces, with what is bound to its parameters.
struct Query {
  std::string sql;
  std::vector<SqlValue> values = {};

  // The parameter that the value is bound to, as text of SQL.
  template <typename Value>
  std::string Bind(Value value) {
    values.emplace_back(std::move(value));
    return "?" + std::to_string(values.size());
  }
};

// A prepared statement on loan; reset and given back at the end of its scope, so that no read
// transaction outlives it.
class Cursor {
 public:
  // `sql`: the key of the owner's idle statements; nullptr = it is not kept.
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
  std::int64_t Run() {  // how many rows it has changed
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

  Cursor Prepare(std::string_view sql);  // one of a limited number of texts: it is kept
  Cursor Prepare(const Query& query);
  // First column of the first row of a statement without parameters.
  std::int64_t Scalar(std::string_view sql) { return Prepare(sql).One().Int(0); }
  virtual void Exec(const std::string& sql) = 0;  // statements without parameters and results

  // Transactions. What reads sees one state; what writes is the only one that does.
  virtual void BeginRead() = 0;
  virtual void BeginWrite() = 0;
  virtual void Commit() = 0;
  virtual void Rollback() noexcept = 0;  // what is open, if anything; never fails visibly
  // Whether the transaction that was begun can go on after a statement has failed, with ROLLBACK
  // TO.
  virtual bool InTransaction() const = 0;

  // Whether a transaction that writes is the only one until this process ends it, or ends; else the
  // database may end it, and each further statement fails.
  virtual bool KeepsItsTurn() const = 0;

  // Whether it can be used again.
  virtual bool IsGood() const { return true; }

  // Features that were read lately, where it is worth to keep them; and FeatureCache's epoch.
  virtual FeatureCache* feature_cache() { return nullptr; }
  virtual std::uint64_t epoch() const { return 0; }

  // Where the databases differ, as text of SQL.
  // Whether `expression` is one of the keys bound to `parameter`.
  virtual std::string IsAmong(const std::string& expression,
                              const std::string& parameter) const = 0;
  // Whether the metadata of image `table` pass. The filter must outlive the query's run.
  virtual std::string Passes(Query& query, const std::string& table,
                             const Filter& filter) const = 0;
  // Counts values of metadata over a query whose columns are `item`, which a value counts once for,
  // and `metadata`, as MetadataOf gives it; rows of an item come one after the other.
  virtual std::string MetadataOf(const std::string& table) const { return table + ".metadata"; }
  virtual std::vector<Facet> CountFacets(const Query& listed, const std::vector<std::string>& keys);
  // Whether each of the words of `text` occurs in one of the columns, whatever its case. The
  // columns are names of `images` (p) or `objects` (o).
  virtual std::string Contains(Query& query, const std::string& text,
                               const std::vector<std::string>& columns) const = 0;

 protected:
  // `kept`: it will run again; else another one that is not kept may be made when it has run.
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
    std::size_t most_idle = 16;  // that are kept
    int wait_ms = 0;             // for one of most_lent
    std::string database = {};   // as people call it
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
  std::uint64_t waits() const {  // times that somebody waited for a free one
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
