// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One SQLite connection with its prepared statements. Private to store/sqlite. Used by one thread
// at a time; throws SQLite::Exception, which SqliteAccess turns into Error (sqlite_error.h).
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>

#include "index/store/sql/connection.h"
#include "index/store/sqlite/row_tests.h"

namespace pliant {

class SqliteConnection : public Connection {
 public:
  // kReadCopy: a file that nobody works on, such as a backup. While it has no log it is read
  // without making any beside it.
  enum class Mode { kReadOnly, kReadWrite, kReadCopy };

  // Opens a file that OpenDatabase (database.h) has checked, and sets the pragmas of a connection.
  SqliteConnection(const std::filesystem::path& path, Mode mode, int busy_timeout_ms);
  ~SqliteConnection() override { ForgetStatements(); }  // before their database

  SQLite::Database& database() { return database_; }

  void Exec(const std::string& sql) override { database_.exec(sql); }
  void BeginRead() override { database_.exec("BEGIN"); }
  void BeginWrite() override { database_.exec("BEGIN IMMEDIATE"); }
  void Commit() override { database_.exec("COMMIT"); }
  void Rollback() noexcept override;
  bool InTransaction() const override;
  bool KeepsItsTurn() const override { return true; }
  std::string IsAmong(const std::string& expression, const std::string& parameter) const override;
  std::string Passes(Query& query, const std::string& table, const Filter& filter) const override;
  std::string Contains(Query& query, const std::string& text,
                       const std::vector<std::string>& columns) const override;
  // The greatest key that was ever given to a row of the table.
  std::int64_t LastKey(const char* table);

 protected:
  std::unique_ptr<Statement> Make(const std::string& sql, bool kept) override;
  [[noreturn]] void ThrowRowMissing() override;

 private:
  BoundPointers bound_;  // before what uses it
  SQLite::Database database_;
};

// Reading connections for many threads. Thread-safe.
class ConnectionPool {
 public:
  ConnectionPool(std::filesystem::path path, int busy_timeout_ms)
      : path_(std::move(path)), busy_timeout_ms_(busy_timeout_ms) {}

  class Lease {
   public:
    Lease(ConnectionPool& pool, std::unique_ptr<SqliteConnection> connection)
        : pool_(&pool), connection_(std::move(connection)) {}
    ~Lease() {
      if (connection_) pool_->GiveBack(std::move(connection_));
    }
    Lease(Lease&&) = default;
    Lease& operator=(Lease&&) = delete;
    SqliteConnection& operator*() const { return *connection_; }
    SqliteConnection* operator->() const { return connection_.get(); }

   private:
    ConnectionPool* pool_;
    std::unique_ptr<SqliteConnection> connection_;
  };

  Lease Borrow();

 private:
  void GiveBack(std::unique_ptr<SqliteConnection> connection) noexcept;

  std::filesystem::path path_;
  int busy_timeout_ms_;
  std::mutex mutex_;  // guards idle_
  std::vector<std::unique_ptr<SqliteConnection>> idle_;
};

}  // namespace pliant
