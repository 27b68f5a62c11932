// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/sqlite_connection.h"

#include <sqlite3.h>
#include <unistd.h>

#include "index/files/fold_case.h"
#include "index/files/text.h"
#include "index/store/sqlite/row_tests.h"

namespace pliant {
namespace {

constexpr std::size_t kMaxIdleConnections = 16;

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

SQLite::Database Open(const std::filesystem::path& path, SqliteConnection::Mode mode,
                      int busy_timeout_ms) {
  switch (mode) {
    case SqliteConnection::Mode::kReadWrite:
      return OpenReadWrite(path, busy_timeout_ms);
    case SqliteConnection::Mode::kReadCopy:
      return OpenCopy(path, busy_timeout_ms);
    default:
      return OpenReadOnly(path, busy_timeout_ms);
  }
}

class SqliteStatement : public Statement {
 public:
  SqliteStatement(SQLite::Database& database, BoundPointers& bound, const std::string& sql)
      : database_(database), bound_(bound), statement_(database, sql) {}
  ~SqliteStatement() override { ForgetPointers(); }

  void Bind(int index, std::int64_t value) override { statement_.bind(index, value); }
  void Bind(int index, double value) override { statement_.bind(index, value); }
  void Bind(int index, const std::string& value) override { statement_.bind(index, value); }
  void Bind(int index, Bytes value) override {
    if (value.size() > std::size_t{1} << 30) {
      throw SQLite::Exception("a value of more than 1 GiB", SQLITE_TOOBIG);
    }
    // A null pointer would bind NULL instead of an empty blob.
    static constexpr char kNothing[1] = {};
    const void* data = value.empty() ? static_cast<const void*>(kNothing) : value.data();
    statement_.bindNoCopy(index, data, static_cast<int>(value.size()));
  }
  void Bind(int index, std::span<const Key> keys) override {
    std::string list = "[";
    for (const Key key : keys) list += (list.size() > 1 ? "," : "") + std::to_string(key);
    statement_.bind(index, list + "]");
  }
  void BindNull(int index) override { statement_.bind(index); }
  void Bind(int index, const SqlPointer& value) override {
    const std::int64_t number = bound_.empty() ? 1 : bound_.rbegin()->first + 1;
    bound_[number] = value;
    pointers_.push_back(number);
    statement_.bind(index, number);
  }

  bool Step() override { return statement_.executeStep(); }
  std::int64_t Changed() override { return database_.getChanges(); }
  void Reset() noexcept override { statement_.tryReset(); }
  void ClearBindings() noexcept override {
    ForgetPointers();
    statement_.clearBindings();
  }

  bool IsNull(int column) const override { return statement_.isColumnNull(column); }
  std::int64_t Int(int column) const override { return Column(column).getInt64(); }
  double Double(int column) const override { return Column(column).getDouble(); }
  std::string Text(int column) const override { return Column(column).getString(); }
  Bytes Blob(int column) const override {
    const SQLite::Column value = Column(column);
    return {static_cast<const std::uint8_t*>(value.getBlob()),
            static_cast<std::size_t>(value.size())};
  }

 private:
  SQLite::Column Column(int column) const { return statement_.getColumn(column); }
  void ForgetPointers() noexcept {
    for (const std::int64_t number : pointers_) bound_.erase(number);
    pointers_.clear();
  }

  SQLite::Database& database_;
  BoundPointers& bound_;
  std::vector<std::int64_t> pointers_;   // in bound_, of this
  mutable SQLite::Statement statement_;  // reading a column is no change
};

}  // namespace

SqliteConnection::SqliteConnection(const std::filesystem::path& path, Mode mode,
                                   int busy_timeout_ms)
    : database_(Open(path, mode, busy_timeout_ms)) {
  AddRowTests(database_.getHandle(), &bound_);
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

// One whose own rollback has failed (for want of memory) is rolled back before the next begins.
void SqliteConnection::Rollback() noexcept {
  if (InTransaction()) database_.tryExec("ROLLBACK");
}

bool SqliteConnection::InTransaction() const {
  return sqlite3_get_autocommit(database_.getHandle()) == 0;
}

std::string SqliteConnection::IsAmong(const std::string& expression,
                                      const std::string& parameter) const {
  return expression + " IN (SELECT value FROM json_each(" + parameter + "))";
}

std::string SqliteConnection::Passes(Query& query, const std::string& table,
                                     const Filter& filter) const {
  return "pliant_passes(" + table + ".metadata, " +
         query.Bind(SqlPointer{{std::shared_ptr<void>(), &filter}, kFilterPointer}) + ")";
}

std::string SqliteConnection::Contains(Query& query, const std::string& text,
                                       const std::vector<std::string>& columns) const {
  std::string sql =
      "pliant_contains(" +
      query.Bind(SqlPointer{std::make_shared<const FoldedText>(FoldedWords(text)), kWordsPointer});
  for (const std::string& column : columns) sql += ", " + column;
  return sql + ")";
}

std::int64_t SqliteConnection::LastKey(const char* table) {
  return Prepare("SELECT coalesce((SELECT seq FROM sqlite_sequence WHERE name = ?), 0)")
      .Bind(std::string(table))
      .One()
      .Int(0);
}

std::unique_ptr<Statement> SqliteConnection::Make(const std::string& sql, bool /*kept*/) {
  return std::make_unique<SqliteStatement>(database_, bound_, sql);
}

void SqliteConnection::ThrowRowMissing() {
  throw SQLite::Exception("a row that must exist is missing", SQLITE_CORRUPT);
}

ConnectionPool::Lease ConnectionPool::Borrow() {
  {
    const std::lock_guard lock(mutex_);
    if (!idle_.empty()) {
      std::unique_ptr<SqliteConnection> connection = std::move(idle_.back());
      idle_.pop_back();
      return {*this, std::move(connection)};
    }
  }
  return {*this, std::make_unique<SqliteConnection>(path_, SqliteConnection::Mode::kReadOnly,
                                                    busy_timeout_ms_)};
}

void ConnectionPool::GiveBack(std::unique_ptr<SqliteConnection> connection) noexcept {
  try {
    connection->Rollback();
    const std::lock_guard lock(mutex_);
    if (idle_.size() < kMaxIdleConnections) idle_.push_back(std::move(connection));
  } catch (const std::exception&) {
    connection.reset();
  }
}

}  // namespace pliant
