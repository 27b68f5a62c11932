// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Private to store/postgres.
#pragma once

#include <string>

namespace pliant::postgres {

// Statements that make the tables of a new database, and a row of each part in `feed`.
std::string SchemaSql();

}  // namespace pliant::postgres
