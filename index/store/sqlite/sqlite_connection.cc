// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/sqlite_connection.h"

#include <algorithm>
#include <exception>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include <sqlite3.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "index/files/durable_file.h"
#include "index/files/text.h"
#include "index/records/filter.h"

namespace pliant {
namespace {

// What SQL cannot say of a row, as functions of the connection:
//   pliant_passes(metadata, FILTER)    whether the filter lets it pass
//   pliant_contains(WORDS, text, ...)  whether each word occurs in one of the texts, in any case
//   pliant_natural(text)               NaturalKey
//   pliant_order(metadata, key)        MetadataOrder
// FILTER and WORDS are numbers of bound values: a Filter, or FoldedText.
using BoundPointers = std::map<std::int64_t, SqlPointer>;
using FoldedText = std::vector<std::u32string>;  // as FoldedWords makes it
constexpr const char* kFilterPointer = "filter";
constexpr const char* kWordsPointer = "words";

std::string_view TextOf(sqlite3_value* value) {
  const auto* text = reinterpret_cast<const char*>(sqlite3_value_text(value));  // NULL: none
  if (text == nullptr) return {};
  return {text, static_cast<std::size_t>(sqlite3_value_bytes(value))};
}

// No exception may pass through SQLite.
template <typename Make>
void Answer(sqlite3_context* context, const Make& make) noexcept {
  try {
    const auto result = make();
    if constexpr (std::is_same_v<decltype(result), const std::string>) {
      sqlite3_result_text64(context, result.data(), result.size(), SQLITE_TRANSIENT, SQLITE_UTF8);
    } else {
      sqlite3_result_int(context, result ? 1 : 0);
    }
  } catch (const std::exception& error) {
    sqlite3_result_error(context, error.what(), -1);
  }
}

template <typename Value>
const Value& Bound(sqlite3_context* context, sqlite3_value* value, const char* type) {
  const auto& all = *static_cast<const BoundPointers*>(sqlite3_user_data(context));
  const SqlPointer& bound = all.at(sqlite3_value_int64(value));
  if (std::string_view(bound.type) != type)
    throw std::invalid_argument("another kind of value is bound");
  return *static_cast<const Value*>(bound.value.get());
}

void PassesFunction(sqlite3_context* context, int /*count*/, sqlite3_value** values) {
  Answer(context, [&] {
    return Passes(Bound<Filter>(context, values[1], kFilterPointer), TextOf(values[0]));
  });
}

void ContainsFunction(sqlite3_context* context, int count, sqlite3_value** values) {
  Answer(context, [&] {
    std::vector<std::string_view> texts;
    for (int i = 1; i < count; ++i) texts.push_back(TextOf(values[i]));
    return count > 0 && OccurIn(Bound<FoldedText>(context, values[0], kWordsPointer), texts);
  });
}

void NaturalFunction(sqlite3_context* context, int /*count*/, sqlite3_value** values) {
  Answer(context, [&] { return NaturalKey(TextOf(values[0])); });
}

void OrderFunction(sqlite3_context* context, int /*count*/, sqlite3_value** values) {
  Answer(context, [&] { return MetadataOrder(TextOf(values[0]), std::string(TextOf(values[1]))); });
}

void AddRowTests(sqlite3* connection, BoundPointers* bound) {
  // Not "deterministic": what they look for changes from statement to statement.
  constexpr int kHow = SQLITE_UTF8 | SQLITE_DIRECTONLY;
  const auto add = [&](const char* name, int arguments, auto* function) {
    const int code = sqlite3_create_function_v2(connection, name, arguments, kHow, bound, function,
                                                nullptr, nullptr, nullptr);
    if (code != SQLITE_OK) throw SQLite::Exception(connection, code);
  };
  add("pliant_passes", 2, &PassesFunction);
  add("pliant_contains", -1, &ContainsFunction);
  add("pliant_natural", 1, &NaturalFunction);
  add("pliant_order", 2, &OrderFunction);
}

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
  if (code == SQLITE_CANTOPEN && !MayWrite(std::filesystem::path(name).parent_path())) {
    throw SQLite::Exception("its log cannot be made", SQLITE_READONLY);
  }
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

bool FailedToWrite(const SQLite::Exception& error) {
  const int kind = error.getErrorCode() & 0xff;
  if (kind != SQLITE_IOERR)
    return kind == SQLITE_FULL || kind == SQLITE_READONLY || kind == SQLITE_PERM;
  // The steps of a copy report no extended code beside theirs.
  const int extended = std::max(error.getErrorCode(), error.getExtendedErrorCode());
  return extended == SQLITE_IOERR_WRITE || extended == SQLITE_IOERR_FSYNC ||
         extended == SQLITE_IOERR_SHMSIZE || extended == SQLITE_IOERR_TRUNCATE;
}

void ThrowAsError(const SQLite::Exception& error, const std::filesystem::path& database) {
  const std::string name = "the database " + database.string();
  const std::string detail = std::string(" (SQLite: ") + error.what() + ")";
  const int kind = error.getErrorCode() & 0xff;
  if ((kind == SQLITE_CANTOPEN || kind == SQLITE_IOERR) && FilesAreUsedUp()) {
    ThrowOutOfFiles(name + " cannot be opened");
  }
  switch (kind) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      throw Error(ErrorCode::kUnavailable, "database_busy",
                  name + " is being written by another process; try again later" + detail);
    case SQLITE_FULL:
      throw Error(ErrorCode::kNoSpace, "disk_full",
                  "no space is left for " + name + "; free some space and run again" + detail);
    case SQLITE_READONLY:
    case SQLITE_PERM:
      throw Error(ErrorCode::kReadOnly, "read_only",
                  name + " cannot be written; check its permissions and file system" + detail);
    case SQLITE_CORRUPT:
      throw Error(ErrorCode::kCorrupt, "database_corrupt",
                  name + " is damaged; restore a backup" + detail);
    case SQLITE_NOTADB:
      throw Error(ErrorCode::kCorrupt, "not_a_database",
                  database.string() + " is not a Pliant database" + detail);
    case SQLITE_CANTOPEN:
      throw Error(ErrorCode::kNotFound, "cannot_open", name + " cannot be opened" + detail);
    case SQLITE_NOMEM:
      throw Error(ErrorCode::kUnavailable, "out_of_memory",
                  "not enough memory to work on " + name + detail);
    case SQLITE_TOOBIG:
      throw Error(ErrorCode::kTooLarge, "value_too_large",
                  "a value is too large for " + name + detail);
    case SQLITE_IOERR:
      if (FailedToWrite(error)) {
        throw Error(
            ErrorCode::kNoSpace, "write_failed",
            "writing " + name + " failed: disk full, over a file size limit, or failing" + detail);
      }
      throw Error(ErrorCode::kInternal, "io_error",
                  "reading or writing " + name + " failed" + detail);
    default:
      throw Error(ErrorCode::kInternal, "database_error",
                  "an unexpected error in " + name + detail);
  }
}

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

}  // namespace pliant
