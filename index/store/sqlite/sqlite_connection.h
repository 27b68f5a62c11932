// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One SQLite connection with its prepared statements. Private to store/sqlite. Used by one thread
// at a time; throws SQLite::Exception, which SqliteAccess turns into Error.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>

#include "index/store/sql/connection.h"

namespace pliant {

// Throws the Error that stands for `error`; the message names the database file.
[[noreturn]] void ThrowAsError(const SQLite::Exception& error,
                               const std::filesystem::path& database);

// Runs `work` and lets out only Error (and what is no database error at all).
template <typename Work>
auto WithDatabaseErrors(const std::filesystem::path& database, Work&& work) {
  try {
    return work();
  } catch (const SQLite::Exception& error) {
    ThrowAsError(error, database);
  }
}

class SqliteConnection : public Connection {
 public:
  // kReadCopy: a file that nobody works on, such as a backup. While it has no log it is read
  // without making any beside it.
  enum class Mode { kReadOnly, kReadWrite, kReadCopy };

  // Opens a file that InspectDatabaseFile (database.h) has checked, and sets the pragmas of a
  // connection.
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
  // What is bound to its statements at the moment, by the numbers that stand for it in SQL. Before
  // what uses it.
  std::map<std::int64_t, SqlPointer> bound_;
  SQLite::Database database_;
};

}  // namespace pliant
