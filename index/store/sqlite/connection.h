// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One SQLite connection with its prepared statements. Private to index/. Used by one thread at a
// time; throws SQLite::Exception, which the facade turns into Error (sqlite_error.h).
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>

#include "descriptor/image/image.h"

namespace pliant {

class Connection;
struct RowTests;

// Binds as NULL when 0.
struct KeyOrNull {
  std::int64_t key = 0;
};

// A prepared statement on loan; reset and given back at the end of its scope, so that no read
// transaction outlives it.
class Cursor {
 public:
  Cursor(Connection& owner, std::unique_ptr<SQLite::Statement> statement)
      : owner_(&owner), statement_(std::move(statement)) {}
  ~Cursor();
  Cursor(Cursor&&) = default;
  Cursor& operator=(Cursor&&) = delete;

  // Binds parameters 1, 2, ... in order. Blobs are not copied: they must outlive the statement's
  // run.
  template <typename... Values>
  Cursor& Bind(const Values&... values) {
    int index = 0;
    (BindOne(++index, values), ...);
    return *this;
  }
  Cursor& Reset() {
    statement_->reset();
    return *this;
  }
  bool Next() { return statement_->executeStep(); }
  void Run() {
    while (statement_->executeStep()) {
    }
  }
  // Next() that must find a row.
  Cursor& One();

  bool IsNull(int column) const { return statement_->isColumnNull(column); }
  std::int64_t Int(int column) const { return statement_->getColumn(column).getInt64(); }
  double Double(int column) const { return statement_->getColumn(column).getDouble(); }
  std::string Text(int column) const { return statement_->getColumn(column).getString(); }
  Bytes Blob(int column) const;  // valid until the next step

 private:
  void BindOne(int index, std::int64_t value) { statement_->bind(index, value); }
  void BindOne(int index, std::uint64_t value) {
    statement_->bind(index, static_cast<std::int64_t>(value));
  }
  void BindOne(int index, int value) { statement_->bind(index, value); }
  void BindOne(int index, std::uint32_t value) { statement_->bind(index, value); }
  void BindOne(int index, double value) { statement_->bind(index, value); }
  void BindOne(int index, const std::string& value) { statement_->bind(index, value); }
  void BindOne(int index, Bytes value);
  void BindOne(int index, const std::vector<std::uint8_t>& value) { BindOne(index, Bytes(value)); }
  void BindOne(int index, KeyOrNull value) {
    value.key != 0 ? statement_->bind(index, value.key) : statement_->bind(index);
  }

  Connection* owner_;
  std::unique_ptr<SQLite::Statement> statement_;
};

class Connection {
 public:
  // kReadCopy: a file that nobody works on, such as a backup. While it has no log it is read
  // without making any beside it.
  enum class Mode { kReadOnly, kReadWrite, kReadCopy };

  // Opens a file that OpenDatabase (database.h) has checked, and sets the pragmas of a connection.
  Connection(const std::filesystem::path& path, Mode mode, int busy_timeout_ms);
  ~Connection();

  SQLite::Database& database() { return database_; }
  Cursor Prepare(std::string_view sql);
  // First column of the first row of a statement without parameters.
  std::int64_t Scalar(std::string_view sql) { return Prepare(sql).One().Int(0); }
  std::int64_t last_insert_key() const { return database_.getLastInsertRowid(); }
  int changes() const { return database_.getChanges(); }
  bool in_transaction() const;
  // From now on what runs ends soon, with the code SQLITE_INTERRUPT, when `stop` says so. It is
  // asked often, and must not throw.
  void StopWhen(std::function<bool()> stop);
  RowTests& row_tests() { return *row_tests_; }  // see row_tests.h
  // Ends a transaction whose own rollback has failed (for want of memory): no other could begin.
  void EndLeftOver() {
    if (in_transaction()) database_.exec("ROLLBACK");
  }

 private:
  friend class Cursor;
  void GiveBack(std::unique_ptr<SQLite::Statement> statement) noexcept;

  std::unique_ptr<RowTests> row_tests_;  // before what uses it
  std::function<bool()> stop_;           // likewise
  SQLite::Database database_;
  std::map<std::string, std::vector<std::unique_ptr<SQLite::Statement>>, std::less<>> idle_;
};

// Reading connections for many threads. Thread-safe.
class ConnectionPool {
 public:
  ConnectionPool(std::filesystem::path path, int busy_timeout_ms)
      : path_(std::move(path)), busy_timeout_ms_(busy_timeout_ms) {}

  class Lease {
   public:
    Lease(ConnectionPool& pool, std::unique_ptr<Connection> connection)
        : pool_(&pool), connection_(std::move(connection)) {}
    ~Lease() {
      if (connection_) pool_->GiveBack(std::move(connection_));
    }
    Lease(Lease&&) = default;
    Lease& operator=(Lease&&) = delete;
    Connection& operator*() const { return *connection_; }
    Connection* operator->() const { return connection_.get(); }

   private:
    ConnectionPool* pool_;
    std::unique_ptr<Connection> connection_;
  };

  Lease Borrow();

 private:
  void GiveBack(std::unique_ptr<Connection> connection) noexcept;

  std::filesystem::path path_;
  int busy_timeout_ms_;
  std::mutex mutex_;  // guards idle_
  std::vector<std::unique_ptr<Connection>> idle_;
};

}  // namespace pliant
