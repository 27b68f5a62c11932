// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/postgres/pg_connection.h"

#include <array>
#include <bit>
#include <cctype>
#include <map>
#include <memory>
#include <optional>
#include <string_view>

#include <libpq-fe.h>
#include <poll.h>

#include "descriptor/base/error.h"
#include "descriptor/base/utf8.h"
#include "index/files/text.h"
#include "index/store/postgres/filter_sql.h"

namespace pliant::postgres {
namespace {

std::string Detail(const char* message) {
  std::string text = message == nullptr ? "" : message;
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  return text.empty() ? "" : " (PostgreSQL: " + text + ")";
}

std::string Named(const std::string& database) { return "the database " + database; }

using std::chrono::milliseconds;

// A server that has said nothing for so long, on any connection, is taken for stopped.
constexpr std::int64_t kSilenceMs = 10'000;
// What was asked of a server before the monitor lost it may still be answered.
constexpr std::int64_t kGraceMs = 3'000;
constexpr std::int64_t kAloneMs = 8'000;  // without a monitor
constexpr milliseconds kLook{200};

// BEGIN and its part's row of `feed`: the owner of the row is the only writer until the end of the
// commit. The name of the log file begins with the timeline, which a promoted standby changes.
std::string BeginWriteSql(int part) {
  return "BEGIN; UPDATE feed SET position = position + 1, "
         "left_at = CASE WHEN timeline = t.now THEN left_at ELSE position END, "
         "history = history + CASE WHEN timeline = t.now THEN 0 ELSE 1 END, timeline = t.now "
         "FROM (SELECT substr(pg_walfile_name(pg_current_wal_insert_lsn()), 1, 8) AS now) t "
         "WHERE key = " +
         std::to_string(part);
}

bool Succeeded(const PGresult* result) {
  const ExecStatusType status = PQresultStatus(result);
  return status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK;
}

// PostgreSQL's pg_type.dat.
constexpr Oid kBytea = 17, kInt8 = 20, kText = 25, kFloat8 = 701, kInt8Array = 1016;

template <typename Integer>
void AppendBigEndian(std::string* bytes, Integer value) {
  for (int shift = sizeof(Integer) * 8 - 8; shift >= 0; shift -= 8) {
    *bytes += static_cast<char>(static_cast<std::make_unsigned_t<Integer>>(value) >> shift);
  }
}

// ? is the next parameter, ?N is parameter N. Texts within quotes are left as they are.
std::string WithDollars(const std::string& sql) {
  std::string out;
  char quote = '\0';
  int next = 0;
  for (std::size_t i = 0; i < sql.size(); ++i) {
    const char c = sql[i];
    if (quote != '\0') {
      if (c == quote) quote = '\0';
    } else if (c == '\'' || c == '"') {
      quote = c;
    } else if (c == '?') {
      out += '$';
      if (i + 1 >= sql.size() || std::isdigit(static_cast<unsigned char>(sql[i + 1])) == 0) {
        out += std::to_string(++next);
      }
      continue;
    }
    out += c;
  }
  return out;
}

// Prepared on the server when it first runs, as only then the types of its parameters are known; a
// parameter has the same type each time. All rows of a result are in memory.
class PgStatement : public Statement {
 public:
  // `sql` has its parameters as ? and ?N.
  PgStatement(PgConnection* connection, const std::string& sql, bool kept)
      : connection_(*connection), sql_(WithDollars(sql)), kept_(kept) {}

  void Bind(int index, std::int64_t value) override {
    std::string bytes;
    AppendBigEndian(&bytes, value);
    Set(index, {kInt8, std::move(bytes)});
  }

  void Bind(int index, double value) override {
    std::string bytes;
    AppendBigEndian(&bytes, std::bit_cast<std::int64_t>(value));
    Set(index, {kFloat8, std::move(bytes)});
  }

  void Bind(int index, const std::string& value) override { Set(index, {kText, value}); }

  void Bind(int index, Bytes value) override {
    if (value.size() > std::size_t{1} << 30) {
      throw Error(ErrorCode::kTooLarge, "value_too_large",
                  "a value of more than 1 GiB is too large for the database");
    }
    static constexpr std::uint8_t kNothing[1] = {};
    Set(index, {kBytea, std::nullopt, value.empty() ? Bytes(kNothing, 0) : value});
  }

  // Binary form of an array: dimensions, whether there are NULLs, type of the elements; of each
  // dimension its size and first index; of each element its size and bytes.
  void Bind(int index, std::span<const Key> keys) override {
    std::string bytes;
    AppendBigEndian(&bytes, std::int32_t{keys.empty() ? 0 : 1});
    AppendBigEndian(&bytes, std::int32_t{0});
    AppendBigEndian(&bytes, static_cast<std::int32_t>(kInt8));
    if (!keys.empty()) {
      AppendBigEndian(&bytes, static_cast<std::int32_t>(keys.size()));
      AppendBigEndian(&bytes, std::int32_t{1});
    }
    for (const Key key : keys) {
      AppendBigEndian(&bytes, std::int32_t{sizeof(Key)});
      AppendBigEndian(&bytes, key);
    }
    Set(index, {kInt8Array, std::move(bytes)});
  }

  void BindNull(int index) override { Set(index, {kInt8, std::nullopt}); }

  void Bind(int /*index*/, const SqlPointer& /*value*/) override {
    throw Error(ErrorCode::kInternal, "database_error", "there are no functions of this process");
  }

  bool Step() override {
    if (!result_) Execute();
    return ++row_ < PQntuples(result_.get());
  }

  std::int64_t Changed() override {
    const char* rows = PQcmdTuples(result_.get());
    return rows[0] == '\0' ? 0 : std::stoll(rows);
  }

  void Reset() noexcept override { result_.reset(); }
  void ClearBindings() noexcept override {}  // all are bound again before the next run

  bool IsNull(int column) const override { return PQgetisnull(result_.get(), row_, column) != 0; }

  std::int64_t Int(int column) const override {
    const Bytes bytes = Blob(column);
    if (bytes.empty()) return 0;  // NULL
    auto value = static_cast<std::uint64_t>(bytes[0] >= 0x80 ? -1 : 0);
    for (const std::uint8_t byte : bytes) value = value << 8 | byte;
    return static_cast<std::int64_t>(value);
  }

  double Double(int column) const override { return std::bit_cast<double>(Int(column)); }

  std::string Text(int column) const override {
    const Bytes bytes = Blob(column);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }

  Bytes Blob(int column) const override {
    return {reinterpret_cast<const std::uint8_t*>(PQgetvalue(result_.get(), row_, column)),
            static_cast<std::size_t>(PQgetlength(result_.get(), row_, column))};
  }

 private:
  struct Parameter {
    Oid type = 0;
    std::optional<std::string> copy;  // of the value; else
    Bytes bytes = {};                 // the value; without data: NULL
  };

  void Set(int index, Parameter parameter) {
    const auto at = static_cast<std::size_t>(index) - 1;
    if (parameters_.size() <= at) parameters_.resize(at + 1);
    parameters_[at] = std::move(parameter);
  }

  void Execute() {
    if (!kept_ || prepared_ != connection_.session()) {
      std::vector<Oid> types;
      for (const Parameter& parameter : parameters_) types.push_back(parameter.type);
      if (kept_) name_ = connection_.NewName();
      connection_.PrepareNamed(name_, sql_, types);
      prepared_ = connection_.session();
    }
    std::vector<const char*> values;
    std::vector<int> lengths;
    for (const Parameter& parameter : parameters_) {
      values.push_back(parameter.copy ? parameter.copy->data()
                                      : reinterpret_cast<const char*>(parameter.bytes.data()));
      lengths.push_back(
          static_cast<int>(parameter.copy ? parameter.copy->size() : parameter.bytes.size()));
    }
    const std::vector<int> formats(parameters_.size(), 1);
    result_ = connection_.RunNamed(name_, values, lengths, formats);
    row_ = -1;
  }

  PgConnection& connection_;
  std::string sql_;             // with parameters as $N
  std::uint64_t prepared_ = 0;  // PgConnection::session() in which it was prepared; 0: never
  const bool kept_;
  std::string name_;  // empty: until another statement without a name is prepared
  std::vector<Parameter> parameters_;
  Result result_;
  int row_ = -1;
};

}  // namespace

Address ParseAddress(const std::string& url) {
  char* message = nullptr;
  const std::unique_ptr<PQconninfoOption, decltype(&PQconninfoFree)> options(
      PQconninfoParse(url.c_str(), &message), &PQconninfoFree);
  PQfreemem(message);  // it may quote a password
  if (!options) {
    throw Error(
        ErrorCode::kInvalidArgument, "database_url_invalid",
        "the URL of the database is not valid; write "
        "postgresql://USER@HOST:PORT/DATABASE, with %XX for special characters, and put the "
        "password into PGPASSWORD or ~/.pgpass");
  }
  std::map<std::string, std::string> values;
  for (const PQconninfoOption* option = options.get(); option->keyword != nullptr; ++option) {
    if (option->val != nullptr) values[option->keyword] = option->val;
  }
  Address address;
  address.url = url;
  address.shown = "postgresql://" + values["host"];
  if (!values["port"].empty()) address.shown += ":" + values["port"];
  address.shown += "/" + values["dbname"];
  const std::string& attributes = values["target_session_attrs"];
  address.reads_on_standby = attributes == "any" || attributes == "read-only" ||
                             attributes == "standby" || attributes == "prefer-standby";
  return address;
}

// Codes: PostgreSQL's manual, appendix A.
[[noreturn]] void ThrowFailed(const PGresult* result, const std::string& database) {
  const char* field = PQresultErrorField(result, PG_DIAG_SQLSTATE);
  const std::string_view state = field == nullptr ? "" : field;
  const std::string_view kind = state.substr(0, 2);
  const std::string name = Named(database);
  const std::string detail = Detail(PQresultErrorField(result, PG_DIAG_MESSAGE_PRIMARY));
  if (state == "53100") {
    throw Error(ErrorCode::kNoSpace, "disk_full",
                "no space is left for " + name + "; free some space and run again" + detail);
  }
  if (state == "55P03") {  // lock_timeout
    throw Error(ErrorCode::kUnavailable, "database_busy",
                name + " is being written by another process; try again later" + detail);
  }
  if (state == "57014" || state == "25P03") {  // 25P03: idle in a transaction
    throw Error(ErrorCode::kUnavailable, "database_unavailable",
                "a statement on " + name + " took too long or was cancelled" + detail);
  }
  if (state == "25006") {
    throw Error(ErrorCode::kUnavailable, "database_unavailable",
                name + " does not accept writes: the server is a standby" + detail);
  }
  if (state == "3F000") {
    throw Error(ErrorCode::kNotFound, "database_not_found",
                name + " has no schema of the name in search_path; create the schema" + detail);
  }
  if (state == "42501") {
    throw Error(ErrorCode::kReadOnly, "read_only",
                "this user lacks a right on " + name + "; grant it" + detail);
  }
  if (state == "54000" || state == "22001") {
    throw Error(ErrorCode::kTooLarge, "value_too_large",
                "a value is too large for " + name + detail);
  }
  if (state == "XX001" || state == "XX002") {
    throw Error(ErrorCode::kCorrupt, "database_corrupt",
                name + " is damaged; restore a backup" + detail);
  }
  // Conflicts between transactions, too little memory or too many connections, a server that
  // starts, ends or is being replaced.
  if (kind == "40" || kind == "53" || kind == "57" || kind == "08") {
    throw Error(ErrorCode::kUnavailable, "database_unavailable",
                name + " is not available; try again later" + detail);
  }
  throw Error(ErrorCode::kInternal, "database_error", "an unexpected error in " + name + detail);
}

[[noreturn]] void ThrowNotConnected(PGconn* connection, const std::string& database) {
  const std::string text = connection == nullptr ? "" : PQerrorMessage(connection);
  const auto says = [&](std::string_view part) { return text.find(part) != std::string::npos; };
  // libpq gives no SQLSTATE for a connection that was not made. These are what the server says in
  // English; in another language the database is just not available.
  if (says("does not exist") && says("database")) {
    throw Error(
        ErrorCode::kNotFound, "database_not_found",
        "there is no database " + database + "; create it with createdb" + Detail(text.c_str()));
  }
  if (says("authentication failed") || says("no password supplied") ||
      says("no pg_hba.conf entry")) {
    throw Error(ErrorCode::kReadOnly, "database_refuses",
                Named(database) + " refuses this user or password; see PGPASSWORD and ~/.pgpass" +
                    Detail(text.c_str()));
  }
  throw Error(ErrorCode::kUnavailable, "database_unavailable",
              Named(database) + " cannot be reached; try again later" + Detail(text.c_str()));
}

[[noreturn]] void ThrowSilent(const std::string& database) {
  throw Error(ErrorCode::kUnavailable, "database_unavailable",
              Named(database) + " does not answer; try again later");
}

[[noreturn]] void ThrowOutcomeUnknown(const std::string& database) {
  throw Error(ErrorCode::kUnavailable, "database_outcome_unknown",
              "the connection to " + database +
                  " was lost before the outcome of the change was known; check before retrying");
}

std::int64_t SteadyMs() {
  return std::chrono::duration_cast<milliseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

PgConnection::PgConnection(const Address* address, const Health* health, Options options)
    : address_(*address), health_(health), options_(std::move(options)) {
  Connect();
}

PgConnection::~PgConnection() {
  ForgetStatements();
  PQfinish(connection_);
}

void PgConnection::Connect() {
  PQfinish(std::exchange(connection_, nullptr));
  losses_ = health_ == nullptr ? 0 : health_->losses.load();
  // Those before the URL can be set in it; those behind it cannot.
  const char* target = options_.target == Target::kPrimary ? "read-write" : nullptr;
  const std::array<const char*, 9> names = {
      "connect_timeout",  "keepalives_idle",      "keepalives_interval",
      "keepalives_count", "tcp_user_timeout",     "application_name",
      "dbname",           "target_session_attrs", nullptr};
  const std::array<const char*, 9> values = {
      "5", "10", "5", "3", "15000", "pliant", address_.url.c_str(), target, nullptr};
  connection_ = PQconnectdbParams(names.data(), values.data(), /*expand_dbname=*/1);
  ++session_;
  if (PQstatus(connection_) != CONNECTION_OK) ThrowNotConnected(connection_, address_.shown);
  PQsetClientEncoding(connection_, "UTF8");
  PQsetnonblocking(connection_, 1);
  const PQnoticeProcessor silent = [](void*, const char*) {};  // not onto standard error
  PQsetNoticeProcessor(connection_, silent, nullptr);
  Exec("SET lock_timeout = " + std::to_string(options_.lock_timeout_ms) +
       "; SET idle_in_transaction_session_timeout = " +
       std::to_string(options_.idle_in_transaction_ms) +
       "; SET standard_conforming_strings = on; SET extra_float_digits = 1" +
       (options_.settings.empty() ? "" : "; " + options_.settings));
}

bool PgConnection::WaitForSocket(milliseconds time, bool writing) const {
  const short events = writing ? POLLIN | POLLOUT : POLLIN;
  pollfd socket{PQsocket(connection_), events, 0};
  return ::poll(&socket, 1, static_cast<int>(time.count())) > 0;
}

// The last result of what was sent. A server that was stopped holds its connections open: then the
// monitor knows.
Result PgConnection::Await() {
  const std::int64_t begun = SteadyMs();
  Result last;
  while (true) {
    for (int unsent = 0; (unsent = PQflush(connection_)) > 0 || PQisBusy(connection_) != 0;) {
      const std::int64_t now = SteadyMs();
      const bool silent = health_ == nullptr
                              ? now - begun > kAloneMs
                              : now - std::max(begun, health_->answered_ms.load()) > kSilenceMs ||
                                    (health_->losses.load() != losses_ && now - begun > kGraceMs);
      if (silent) {
        PQfinish(std::exchange(connection_, nullptr));
        ThrowSilent(address_.shown);
      }
      WaitForSocket(kLook, unsent > 0);
      if (PQconsumeInput(connection_) == 0) break;  // the connection is gone
    }
    Result next(PQgetResult(connection_));
    if (!next) break;
    // The first that failed says why; those behind it were not begun.
    if (!last || Succeeded(last.get())) last = std::move(next);
  }
  if (!last || PQstatus(connection_) != CONNECTION_OK) {
    if (last && !Succeeded(last.get()) && PQresultErrorField(last.get(), PG_DIAG_SQLSTATE)) {
      ThrowFailed(last.get(), address_.shown);
    }
    ThrowNotConnected(connection_, address_.shown);
  }
  if (!Succeeded(last.get())) ThrowFailed(last.get(), address_.shown);
  return last;
}

void PgConnection::Exec(const std::string& sql) {
  if (PQsendQuery(connection_, sql.c_str()) == 0) ThrowNotConnected(connection_, address_.shown);
  Await();
}

void PgConnection::PrepareNamed(const std::string& name, const std::string& sql,
                                std::span<const Oid> types) {
  if (PQsendPrepare(connection_, name.c_str(), sql.c_str(), static_cast<int>(types.size()),
                    types.data()) == 0) {
    ThrowNotConnected(connection_, address_.shown);
  }
  Await();
}

Result PgConnection::RunNamed(const std::string& name, std::span<const char* const> values,
                              std::span<const int> lengths, std::span<const int> formats) {
  if (PQsendQueryPrepared(connection_, name.c_str(), static_cast<int>(values.size()), values.data(),
                          lengths.data(), formats.data(),
                          /*resultFormat: binary*/ 1) == 0) {
    ThrowNotConnected(connection_, address_.shown);
  }
  return Await();
}

// A connection that has ended since it was used last is made again, before anything is asked of it.
void PgConnection::Begin(const std::string& sql) {
  const std::uint64_t session = session_;
  if (!IsGood()) Connect();
  try {
    Exec(sql);
  } catch (const Error&) {
    if (connection_ != nullptr && PQstatus(connection_) == CONNECTION_OK) throw;
    if (session_ != session) throw;
    Connect();
    Exec(sql);
  }
}

void PgConnection::BeginRead() { Begin("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY"); }

void PgConnection::BeginWrite() { Begin(BeginWriteSql(options_.part)); }

void PgConnection::Commit() {
  const std::string sql = "NOTIFY pliant; COMMIT";
  if (PQsendQuery(connection_, sql.c_str()) == 0) ThrowNotConnected(connection_, address_.shown);
  try {
    const Result result = Await();
    if (std::string_view(PQcmdStatus(result.get())) == "COMMIT") return;
  } catch (const Error&) {
    if (connection_ != nullptr && PQstatus(connection_) == CONNECTION_OK) throw;
    ThrowOutcomeUnknown(address_.shown);
  }
  throw Error(ErrorCode::kInternal, "database_error",
              "a transaction on the database " + address_.shown + " was rolled back");
}

void PgConnection::Rollback() noexcept {
  if (connection_ == nullptr || PQtransactionStatus(connection_) == PQTRANS_IDLE) return;
  try {
    Exec("ROLLBACK");
  } catch (const std::exception&) {
    // The connection has ended, and the transaction with it; the next one is on a new connection.
    PQfinish(std::exchange(connection_, nullptr));
  }
}

bool PgConnection::InTransaction() const {
  if (connection_ == nullptr) return false;
  const PGTransactionStatusType status = PQtransactionStatus(connection_);
  return status == PQTRANS_INTRANS || status == PQTRANS_INERROR;
}

bool PgConnection::IsStandby() const {
  const char* standby = PQparameterStatus(connection_, "in_hot_standby");
  return standby != nullptr && std::string_view(standby) == "on";
}

bool PgConnection::IsGood() const {
  return connection_ != nullptr && PQstatus(connection_) == CONNECTION_OK &&
         (health_ == nullptr || health_->losses.load() == losses_);
}

bool PgConnection::WaitForNotice(milliseconds time) {
  const auto take = [&] {
    if (PQconsumeInput(connection_) == 0) ThrowNotConnected(connection_, address_.shown);
    bool any = false;
    while (PGnotify* notice = PQnotifies(connection_)) {
      PQfreemem(notice);
      any = true;
    }
    return any;
  };
  return take() || (WaitForSocket(time) && take());
}

std::string PgConnection::IsAmong(const std::string& expression,
                                  const std::string& parameter) const {
  return expression + " = ANY(" + parameter + ")";
}

std::string PgConnection::Passes(Query& query, const std::string& table,
                                 const Filter& filter) const {
  return FilterSql(query, table, filter);
}

std::vector<Facet> PgConnection::CountFacets(const Query& listed,
                                             const std::vector<std::string>& keys) {
  std::vector<Facet> facets;
  for (const std::string& key : keys) facets.push_back(CountFacet(*this, listed, key));
  return facets;
}

// As FoldCase does: by way of the upper case.
std::string PgConnection::Contains(Query& query, const std::string& text,
                                   const std::vector<std::string>& columns) const {
  std::string all = "TRUE";
  for (const std::u32string& word : FoldedWords(text)) {
    const std::string parameter = query.Bind(EncodeUtf8(word));
    std::string any;
    for (const std::string& column : columns) {
      any += any.empty() ? "" : " OR ";
      any += "strpos(lower(upper(coalesce(" + column + ", '') COLLATE pliant_fold)), " + parameter +
             ") > 0";
    }
    all += " AND (" + any + ")";
  }
  return "(" + all + ")";
}

std::string PgConnection::NaturalKeyOf(const std::string& text) const {
  return NaturalKeySql(text);
}

std::string PgConnection::MetadataOrderOf(Query& query, const std::string& table,
                                          const std::string& key) const {
  return MetadataOrderSql(query, table, key);
}

std::unique_ptr<Statement> PgConnection::Make(const std::string& sql, bool kept) {
  return std::make_unique<PgStatement>(this, sql, kept);
}

void PgConnection::ThrowRowMissing() {
  throw Error(ErrorCode::kCorrupt, "database_corrupt",
              "a row that must exist is missing in the database " + address_.shown);
}

}  // namespace pliant::postgres
