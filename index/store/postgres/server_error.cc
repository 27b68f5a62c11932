// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/postgres/server_error.h"

#include <string_view>

#include "descriptor/base/error.h"

namespace pliant::postgres {
namespace {

std::string Detail(const char* message) {
  std::string text = message == nullptr ? "" : message;
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  return text.empty() ? "" : " (PostgreSQL: " + text + ")";
}

std::string Named(const std::string& database) { return "the database " + database; }

}  // namespace

// Codes: PostgreSQL's manual, appendix A.
[[noreturn]] void ThrowFailed(const PGresult* result, const std::string& database) {
  const char* field = PQresultErrorField(result, PG_DIAG_SQLSTATE);
  const std::string_view state = field == nullptr ? "" : field;
  const std::string_view kind = state.substr(0, 2);
  const std::string name = Named(database);
  const std::string detail = Detail(PQresultErrorField(result, PG_DIAG_MESSAGE_PRIMARY));
  if (state == "53100") {
    throw Error(ErrorCode::kNoSpace, "disk_full",
                "no space is left for " + name + "; free some and run again" + detail);
  }
  if (state == "55P03") {  // lock_timeout
    throw Error(ErrorCode::kUnavailable, "database_busy",
                name + " is being written by another process; try again later" + detail);
  }
  if (state == "57014" || state == "25P03") {  // 25P03: idle in a transaction
    throw Error(ErrorCode::kUnavailable, "database_unavailable",
                "a statement on " + name + " took too long or was cancelled" + detail);
  }
  if (state == "25006") {
    throw Error(ErrorCode::kUnavailable, "database_unavailable",
                name + " takes no writes at the moment: the server is a standby" + detail);
  }
  if (state == "3F000") {
    throw Error(ErrorCode::kNotFound, "database_not_found",
                name + " has no schema of the name in search_path; create it" + detail);
  }
  if (state == "42501") {
    throw Error(ErrorCode::kReadOnly, "read_only",
                "this user may not do that on " + name + "; grant the right" + detail);
  }
  if (state == "54000" || state == "22001") {
    throw Error(ErrorCode::kTooLarge, "value_too_large", "too large for " + name + detail);
  }
  if (state == "XX001" || state == "XX002") {
    throw Error(ErrorCode::kCorrupt, "database_corrupt",
                name + " is damaged; restore a backup" + detail);
  }
  // Conflicts between transactions, too little memory or too many connections, a server that
  // starts, ends or is being replaced.
  if (kind == "40" || kind == "53" || kind == "57" || kind == "08") {
    throw Error(ErrorCode::kUnavailable, "database_unavailable",
                name + " is not available; try again later" + detail);
  }
  throw Error(ErrorCode::kInternal, "database_error", "an unexpected error of " + name + detail);
}

[[noreturn]] void ThrowNotConnected(PGconn* connection, const std::string& database) {
  const std::string text = connection == nullptr ? "" : PQerrorMessage(connection);
  const auto says = [&](std::string_view part) { return text.find(part) != std::string::npos; };
  // libpq gives no SQLSTATE for a connection that was not made. These are what the server says in
  // English; in another language the database is just not available.
  if (says("does not exist") && says("database")) {
    throw Error(
        ErrorCode::kNotFound, "database_not_found",
        "there is no database " + database + "; create it with createdb" + Detail(text.c_str()));
  }
  if (says("authentication failed") || says("no password supplied") ||
      says("no pg_hba.conf entry")) {
    throw Error(ErrorCode::kReadOnly, "database_refuses",
                Named(database) + " refuses this user or password; see PGPASSWORD and ~/.pgpass" +
                    Detail(text.c_str()));
  }
  throw Error(ErrorCode::kUnavailable, "database_unavailable",
              Named(database) + " cannot be reached; try again later" + Detail(text.c_str()));
}

[[noreturn]] void ThrowSilent(const std::string& database) {
  throw Error(ErrorCode::kUnavailable, "database_unavailable",
              Named(database) + " does not answer; try again later");
}

[[noreturn]] void ThrowOutcomeUnknown(const std::string& database) {
  throw Error(ErrorCode::kUnavailable, "database_outcome_unknown",
              "the connection to " + database +
                  " ended before it said whether the change was made; send the same request again");
}

}  // namespace pliant::postgres
