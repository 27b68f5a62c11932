// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What SQL cannot say of a row: SQL functions of a connection. Private to store/sqlite.
//   pliant_passes(metadata, FILTER)       whether the filter lets it pass
//   pliant_contains(WORDS, text, ...)     whether each word occurs in one of the texts, whatever its
//                                         case
#pragma once

#include <string>
#include <vector>

struct sqlite3;

namespace pliant {

using FoldedText = std::vector<std::u32string>;  // FoldedWords (fold_case.h)

// What FILTER and WORDS are: pointers to Filter and FoldedText that are bound with these names.
inline constexpr const char* kFilterPointer = "pliant filter";
inline constexpr const char* kWordsPointer = "pliant words";

// Throws SQLite::Exception.
void AddRowTests(sqlite3* connection);

}  // namespace pliant
