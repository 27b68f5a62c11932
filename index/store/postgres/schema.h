// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Private to store/postgres.
#pragma once

namespace pliant::postgres {

// Statements that make the tables of a new database, and a row of each part in `feed`.
extern const char* const kSchema;

}  // namespace pliant::postgres
