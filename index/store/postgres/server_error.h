// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// PostgreSQL's errors as Pliant's. Private to store/postgres.
#pragma once

#include <string>

#include <libpq-fe.h>

namespace pliant::postgres {

// Throws the Error that stands for a failed result, by its SQLSTATE; `database` is what people call
// it.
[[noreturn]] void ThrowFailed(const PGresult* result, const std::string& database);
// No connection, or one that has broken: kUnavailable "database_unavailable", or what the server
// says against the connection (no such database, password).
[[noreturn]] void ThrowNotConnected(PGconn* connection, const std::string& database);
// The server does not answer.
[[noreturn]] void ThrowSilent(const std::string& database);
// It broke while a transaction was being committed: kUnavailable "database_outcome_unknown".
[[noreturn]] void ThrowOutcomeUnknown(const std::string& database);

}  // namespace pliant::postgres
