// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/connection.h"

#include <sqlite3.h>
#include <unistd.h>

#include "index/files/text.h"
#include "index/store/sqlite/row_tests.h"

namespace pliant {
namespace {

constexpr std::size_t kMaxIdleConnections = 16;
constexpr int kStepsBetweenLooks = 1000;  // of SQLite's virtual machine, for StopWhen

// SQLite reads a name that begins with "file:" as a URI; an absolute one never does.
std::string FileName(const std::filesystem::path& path) {
  return std::filesystem::absolute(path).string();
}

bool MayWrite(const std::filesystem::path& path) { return ::access(path.c_str(), W_OK) == 0; }

SQLite::Database OpenImmutable(const std::string& name, int busy_timeout_ms) {
  return {"file:" + PercentEncode(name, "/.-_") + "?immutable=1",
          SQLite::OPEN_READONLY | SQLite::OPEN_URI, busy_timeout_ms};
}

bool HasLog(const std::string& name) { return std::filesystem::exists(name + "-wal"); }

SQLite::Database OpenReadOnly(const std::filesystem::path& path, int busy_timeout_ms) {
  const std::string name = FileName(path);
  SQLite::Database database(name, SQLite::OPEN_READONLY, busy_timeout_ms);
  // On read-only media WAL's side files cannot be made. A cleanly closed database has none and
  // nobody can change it there: read it as immutable. Where they could be made and were not (no
  // file descriptor left, a failing disk) others may write, and an immutable one would not see it.
  const int code = database.tryExec("SELECT 1 FROM sqlite_schema") & 0xff;
  if ((code == SQLITE_CANTOPEN || code == SQLITE_READONLY) && !HasLog(name) &&
      !MayWrite(std::filesystem::path(name).parent_path())) {
    return OpenImmutable(name, busy_timeout_ms);
  }
  return database;
}

SQLite::Database OpenCopy(const std::filesystem::path& path, int busy_timeout_ms) {
  const std::string name = FileName(path);
  return HasLog(name) ? OpenReadOnly(path, busy_timeout_ms) : OpenImmutable(name, busy_timeout_ms);
}

// SQLite opens a file for reading when it cannot for writing, whatever the reason; its log, too,
// which the first transaction opens. A connection like that would refuse to write for ever.
SQLite::Database OpenReadWrite(const std::filesystem::path& path, int busy_timeout_ms) {
  const std::string name = FileName(path);
  SQLite::Database database(name, SQLite::OPEN_READWRITE);
  const int code = database.tryExec("BEGIN IMMEDIATE") & 0xff;  // waits for nobody
  if (code == SQLITE_OK) database.exec("ROLLBACK");
  const bool only_reads =
      code == SQLITE_READONLY || sqlite3_db_readonly(database.getHandle(), "main") != 0;
  if (only_reads && MayWrite(name)) {
    throw SQLite::Exception("the file could not be opened for writing", SQLITE_CANTOPEN);
  }
  database.setBusyTimeout(busy_timeout_ms);
  return database;
}

SQLite::Database Open(const std::filesystem::path& path, Connection::Mode mode,
                      int busy_timeout_ms) {
  switch (mode) {
    case Connection::Mode::kReadWrite:
      return OpenReadWrite(path, busy_timeout_ms);
    case Connection::Mode::kReadCopy:
      return OpenCopy(path, busy_timeout_ms);
    default:
      return OpenReadOnly(path, busy_timeout_ms);
  }
}

}  // namespace

Cursor::~Cursor() {
  if (statement_) owner_->GiveBack(std::move(statement_));
}

Cursor& Cursor::One() {
  if (!Next()) throw SQLite::Exception("a row that must exist is missing", SQLITE_CORRUPT);
  return *this;
}

Bytes Cursor::Blob(int column) const {
  const SQLite::Column value = statement_->getColumn(column);
  return {static_cast<const std::uint8_t*>(value.getBlob()),
          static_cast<std::size_t>(value.size())};
}

void Cursor::BindOne(int index, Bytes value) {
  if (value.size() > std::size_t{1} << 30) {
    throw SQLite::Exception("a value of more than 1 GiB", SQLITE_TOOBIG);
  }
  // A null pointer would bind NULL instead of an empty blob.
  static constexpr char kNothing[1] = {};
  const void* data = value.empty() ? static_cast<const void*>(kNothing) : value.data();
  statement_->bindNoCopy(index, data, static_cast<int>(value.size()));
}

Connection::Connection(const std::filesystem::path& path, Mode mode, int busy_timeout_ms)
    : row_tests_(std::make_unique<RowTests>()), database_(Open(path, mode, busy_timeout_ms)) {
  AddRowTests(database_.getHandle(), row_tests_.get());
  // A file may come from elsewhere: its schema is given no more than it needs.
  sqlite3_db_config(database_.getHandle(), SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(database_.getHandle(), SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  database_.exec("PRAGMA foreign_keys = ON");
  if (mode == Mode::kReadWrite) {
    database_.exec("PRAGMA synchronous = FULL");
    database_.exec("PRAGMA secure_delete = ON");
    database_.exec("PRAGMA journal_size_limit = 67108864");
  }
}

Connection::~Connection() = default;

Cursor Connection::Prepare(std::string_view sql) {
  if (const auto found = idle_.find(sql); found != idle_.end() && !found->second.empty()) {
    std::unique_ptr<SQLite::Statement> statement = std::move(found->second.back());
    found->second.pop_back();
    return {*this, std::move(statement)};
  }
  return {*this, std::make_unique<SQLite::Statement>(database_, std::string(sql))};
}

bool Connection::in_transaction() const {
  return sqlite3_get_autocommit(database_.getHandle()) == 0;
}

void Connection::StopWhen(std::function<bool()> stop) {
  stop_ = std::move(stop);
  const auto look = [](void* asked) {
    return (*static_cast<std::function<bool()>*>(asked))() ? 1 : 0;
  };
  sqlite3_progress_handler(database_.getHandle(), kStepsBetweenLooks, look, &stop_);
}

void Connection::GiveBack(std::unique_ptr<SQLite::Statement> statement) noexcept {
  statement->tryReset();  // its error was thrown when the statement ran
  try {
    statement->clearBindings();
    idle_[statement->getQuery()].push_back(std::move(statement));
  } catch (const std::exception&) {
    statement.reset();  // no memory to keep it: prepared anew next time
  }
}

ConnectionPool::Lease ConnectionPool::Borrow() {
  {
    const std::lock_guard lock(mutex_);
    if (!idle_.empty()) {
      std::unique_ptr<Connection> connection = std::move(idle_.back());
      idle_.pop_back();
      return {*this, std::move(connection)};
    }
  }
  return {*this,
          std::make_unique<Connection>(path_, Connection::Mode::kReadOnly, busy_timeout_ms_)};
}

void ConnectionPool::GiveBack(std::unique_ptr<Connection> connection) noexcept {
  try {
    connection->EndLeftOver();
    const std::lock_guard lock(mutex_);
    if (idle_.size() < kMaxIdleConnections) idle_.push_back(std::move(connection));
  } catch (const std::exception&) {
    connection.reset();
  }
}

}  // namespace pliant
