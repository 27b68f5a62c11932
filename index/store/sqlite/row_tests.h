// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What SQL cannot say of a row: SQL functions of a connection. Private to store/sqlite.
//   pliant_passes(metadata)     whether the filter lets it pass
//   pliant_contains(text, ...)  whether each word occurs in one of the texts, whatever its case
#pragma once

#include <string>
#include <vector>

#include "index/records/filter.h"
#include "index/records/listing.h"

struct sqlite3;

namespace pliant {

class Connection;

// What the functions of one connection look for at the moment; without, all rows pass.
struct RowTests {
  const Filter* filter = nullptr;
  std::vector<std::u32string> words;  // folded
};

// `tests` must outlive the connection's statements. Throws SQLite::Exception.
void AddRowTests(sqlite3* connection, RowTests* tests);

// Sets what the functions of `db` look for, for as long as it lives. `which` must outlive it. One
// at a time on a connection.
class RowTestScope {
 public:
  RowTestScope(Connection& db, const Selection& which);
  ~RowTestScope();
  RowTestScope(const RowTestScope&) = delete;
  RowTestScope& operator=(const RowTestScope&) = delete;

 private:
  RowTests& tests_;
};

}  // namespace pliant
