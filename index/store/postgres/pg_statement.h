// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Private to store/postgres.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "index/store/postgres/pg_connection.h"
#include "index/store/sql/connection.h"

namespace pliant::postgres {

// Prepared on the server when it first runs, as only then the types of its parameters are known; a
// parameter has the same type each time. All rows of a result are in memory.
class PgStatement : public Statement {
 public:
  // With parameters as ? and ?N.
  PgStatement(PgConnection* connection, const std::string& sql, bool kept);

  void Bind(int index, std::int64_t value) override;
  void Bind(int index, double value) override;
  void Bind(int index, const std::string& value) override;
  void Bind(int index, Bytes value) override;
  void Bind(int index, std::span<const Key> keys) override;
  void BindNull(int index) override;
  void Bind(int index, const SqlPointer& value) override;

  bool Step() override;
  std::int64_t Changed() override;
  void Reset() noexcept override;
  void ClearBindings() noexcept override {}  // all are bound again before the next run

  bool IsNull(int column) const override;
  std::int64_t Int(int column) const override;
  double Double(int column) const override;
  std::string Text(int column) const override;
  Bytes Blob(int column) const override;

 private:
  struct Parameter {
    Oid type = 0;
    std::optional<std::string> copy;  // of the value; else
    Bytes bytes = {};                 // the value; without data: NULL
  };
  void Set(int index, Parameter parameter);
  void Execute();

  PgConnection& connection_;
  std::string sql_;             // with parameters as $N
  std::uint64_t prepared_ = 0;  // PgConnection::session() in which it was prepared; 0: never
  const bool kept_;
  std::string name_;  // empty: until another statement without a name is prepared
  std::vector<Parameter> parameters_;
  Result result_;
  int row_ = -1;
};

}  // namespace pliant::postgres
