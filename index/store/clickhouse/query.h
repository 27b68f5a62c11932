// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A SELECT and its rows.
#pragma once

#include <string>
#include <vector>

#include "index/store/clickhouse/http_pool.h"
#include "index/store/clickhouse/native_reader.h"
#include "index/store/clickhouse/statements.h"

namespace pliant::clickhouse {

// All rows in one block, with these columns ("FORMAT Native" is added to the statement). Throws
// what HttpPool throws and kCorrupt "answer_corrupt".
NativeBlock ReadRows(HttpPool& pool, DatabaseRequest request,
                     const std::vector<TableColumn>& columns);

// 'text' as a literal.
std::string Literal(std::string_view text);

}  // namespace pliant::clickhouse
