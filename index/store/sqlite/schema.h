// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The tables of a database file. Private to index/. index/FORMAT.md describes them.
#pragma once

#include <cstdint>

#include <SQLiteCpp/Database.h>

namespace pliant {

inline constexpr std::uint32_t kApplicationId = 0x504C4E54;  // "PLNT", at byte 68 of the file

// Makes all tables in an empty database and sets user_version to kSchemaVersion (refusals.h).
void MakeTables(SQLite::Database& database);

}  // namespace pliant
