// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sql/connection.h"

#include "index/store/facet_count.h"

namespace pliant {

Cursor::~Cursor() {
  if (!statement_ || sql_ == nullptr) return;
  statement_->Reset();  // its error was thrown when the statement ran
  statement_->ClearBindings();
  owner_->idle_.find(*sql_)->second.push_back(std::move(statement_));
}

Cursor& Cursor::One() {
  if (!Next()) owner_->ThrowRowMissing();
  return *this;
}

void Cursor::BindOne(int index, const SqlValue& value) {
  if (const auto* number = std::get_if<std::int64_t>(&value)) {
    statement_->Bind(index, *number);
  } else if (const auto* text = std::get_if<std::string>(&value)) {
    statement_->Bind(index, *text);
  } else {
    statement_->Bind(index, std::get<SqlPointer>(value));
  }
}

Cursor Connection::Prepare(std::string_view sql) {
  auto found = idle_.find(sql);
  if (found == idle_.end()) {
    found = idle_.emplace(std::string(sql), std::vector<std::unique_ptr<Statement>>()).first;
  }
  if (found->second.empty()) return {*this, &found->first, Make(found->first, true)};
  std::unique_ptr<Statement> statement = std::move(found->second.back());
  found->second.pop_back();
  return {*this, &found->first, std::move(statement)};
}

Cursor Connection::Prepare(const Query& query) {
  Cursor cursor(*this, nullptr, Make(query.sql, false));
  for (std::size_t i = 0; i < query.values.size(); ++i) {
    cursor.BindOne(static_cast<int>(i) + 1, query.values[i]);
  }
  return cursor;
}

std::vector<Facet> Connection::CountFacets(const Query& listed,
                                           const std::vector<std::string>& keys) {
  FacetCount count(keys);
  Cursor row = Prepare(listed);
  Key item = 0;
  while (row.Next()) {
    if (row.Int(0) != item) count.BeginItem();
    item = row.Int(0);
    count.Add(row.Text(1));
  }
  return count.Result();
}

}  // namespace pliant
