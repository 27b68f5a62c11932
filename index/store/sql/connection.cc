// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sql/connection.h"

#include <chrono>

#include "descriptor/base/error.h"
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

std::unique_ptr<Connection> ConnectionPool::Borrow() {
  std::unique_lock lock(mutex_);
  const auto is_free = [this] { return lent_ < options_.most_lent; };
  if (!is_free()) ++waits_;
  if (!changed_.wait_for(lock, std::chrono::milliseconds(options_.wait_ms), is_free)) {
    throw Error(
        ErrorCode::kUnavailable, "database_busy",
        "All connections to the database " + options_.database + " are in use. Try again later.");
  }
  ++lent_;
  std::erase_if(idle_, [](const auto& connection) { return !connection->IsGood(); });
  if (!idle_.empty()) {
    std::unique_ptr<Connection> connection = std::move(idle_.back());
    idle_.pop_back();
    return connection;
  }
  lock.unlock();
  try {
    return options_.open();
  } catch (...) {
    GiveBack(nullptr);
    throw;
  }
}

void ConnectionPool::GiveBack(std::unique_ptr<Connection> connection) noexcept {
  if (connection) connection->Rollback();
  const std::lock_guard lock(mutex_);
  --lent_;
  changed_.notify_one();
  if (connection && connection->IsGood() && idle_.size() < options_.most_idle) {
    idle_.push_back(std::move(connection));
  }
}

ReadTransaction::ReadTransaction(ConnectionPool* pool) : pool_(*pool), connection_(pool->Borrow()) {
  try {
    connection_->BeginRead();
  } catch (...) {
    pool_.GiveBack(std::move(connection_));
    throw;
  }
}

}  // namespace pliant
