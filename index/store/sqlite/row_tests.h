// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What SQL cannot say of a row: SQL functions of a connection. Private to store/sqlite.
//   pliant_passes(metadata, FILTER)       whether the filter lets it pass
//   pliant_contains(WORDS, text, ...)     whether each word occurs in one of the texts, whatever
//   its
//                                         case
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "index/store/sql/connection.h"

struct sqlite3;

namespace pliant {

using FoldedText = std::vector<std::u32string>;  // FoldedWords (fold_case.h)

// FILTER and WORDS are numbers of what is bound to the statements of a connection at the moment,
// with what it is: a Filter, or FoldedText.
inline constexpr const char* kFilterPointer = "filter";
inline constexpr const char* kWordsPointer = "words";

using BoundPointers = std::map<std::int64_t, SqlPointer>;

// `bound` must outlive the connection's statements. Throws SQLite::Exception.
void AddRowTests(sqlite3* connection, BoundPointers* bound);

}  // namespace pliant
