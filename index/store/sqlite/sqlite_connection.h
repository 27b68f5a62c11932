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

// Throws the Error for `error`; the message names the database file.
[[noreturn]] void ThrowAsError(const SQLite::Exception& error,
                               const std::filesystem::path& database);

// Whether SQLite could not write: no space, over a file size limit, or no permission.
bool FailedToWrite(const SQLite::Exception& error);

// Runs `work` and throws only Error (and exceptions that are not database errors). `written`: the
// file that `work` writes, if it is another.
template <typename Work>
auto WithDatabaseErrors(const std::filesystem::path& database, Work&& work,
                        const std::filesystem::path& written = {}) {
  try {
    return work();
  } catch (const SQLite::Exception& error) {
    ThrowAsError(error, !written.empty() && FailedToWrite(error) ? written : database);
  }
}

class SqliteConnection : public Connection {
 public:
  // kReadCopy: a file that no process uses, such as a backup. If it has no log, reading creates
  // none.
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
  std::string NaturalKeyOf(const std::string& text) const override {
    return "pliant_natural(" + text + ")";
  }
  std::string MetadataOrderOf(Query& query, const std::string& table,
                              const std::string& key) const override {
    return "pliant_order(" + table + ".metadata, " + query.Bind(key) + ")";
  }
  // The greatest key that was ever given to a row of the table.
  std::int64_t LastKey(const char* table);

 protected:
  std::unique_ptr<Statement> Make(const std::string& sql, bool kept) override;
  [[noreturn]] void ThrowRowMissing() override;

 private:
  // The values bound to its statements, by their numbers in SQL. Declared before the members that
  // use it.
  std::map<std::int64_t, SqlPointer> bound_;
  SQLite::Database database_;
};

}  // namespace pliant
