// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/postgres/pg_statement.h"

#include <bit>
#include <cctype>

#include "descriptor/base/error.h"

namespace pliant::postgres {
namespace {

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

}  // namespace

PgStatement::PgStatement(PgConnection* connection, const std::string& sql, bool kept)
    : connection_(*connection), sql_(WithDollars(sql)), kept_(kept) {}

void PgStatement::Set(int index, Parameter parameter) {
  const auto at = static_cast<std::size_t>(index) - 1;
  if (parameters_.size() <= at) parameters_.resize(at + 1);
  parameters_[at] = std::move(parameter);
}

void PgStatement::Bind(int index, std::int64_t value) {
  std::string bytes;
  AppendBigEndian(&bytes, value);
  Set(index, {kInt8, std::move(bytes)});
}

void PgStatement::Bind(int index, double value) {
  std::string bytes;
  AppendBigEndian(&bytes, std::bit_cast<std::int64_t>(value));
  Set(index, {kFloat8, std::move(bytes)});
}

void PgStatement::Bind(int index, const std::string& value) { Set(index, {kText, value}); }

void PgStatement::Bind(int index, Bytes value) {
  if (value.size() > std::size_t{1} << 30) {
    throw Error(ErrorCode::kTooLarge, "value_too_large",
                "a value of more than 1 GiB is too large for the database");
  }
  static constexpr std::uint8_t kNothing[1] = {};
  Set(index, {kBytea, std::nullopt, value.empty() ? Bytes(kNothing, 0) : value});
}

// Binary form of an array: dimensions, whether there are NULLs, type of the elements; of each
// dimension its size and first index; of each element its size and bytes.
void PgStatement::Bind(int index, std::span<const Key> keys) {
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

void PgStatement::BindNull(int index) { Set(index, {kInt8, std::nullopt}); }

void PgStatement::Bind(int /*index*/, const SqlPointer& /*value*/) {
  throw Error(ErrorCode::kInternal, "database_error", "there are no functions of this process");
}

void PgStatement::Execute() {
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

bool PgStatement::Step() {
  if (!result_) Execute();
  return ++row_ < PQntuples(result_.get());
}

std::int64_t PgStatement::Changed() {
  const char* rows = PQcmdTuples(result_.get());
  return rows[0] == '\0' ? 0 : std::stoll(rows);
}

void PgStatement::Reset() noexcept { result_.reset(); }

bool PgStatement::IsNull(int column) const { return PQgetisnull(result_.get(), row_, column) != 0; }

std::int64_t PgStatement::Int(int column) const {
  const Bytes bytes = Blob(column);
  if (bytes.empty()) return 0;  // NULL
  auto value = static_cast<std::uint64_t>(bytes[0] >= 0x80 ? -1 : 0);
  for (const std::uint8_t byte : bytes) value = value << 8 | byte;
  return static_cast<std::int64_t>(value);
}

double PgStatement::Double(int column) const { return std::bit_cast<double>(Int(column)); }

std::string PgStatement::Text(int column) const {
  const Bytes bytes = Blob(column);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

Bytes PgStatement::Blob(int column) const {
  return {reinterpret_cast<const std::uint8_t*>(PQgetvalue(result_.get(), row_, column)),
          static_cast<std::size_t>(PQgetlength(result_.get(), row_, column))};
}

}  // namespace pliant::postgres
