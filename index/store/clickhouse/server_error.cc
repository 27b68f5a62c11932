// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/server_error.h"

#include <array>
#include <charconv>

#include "index/files/text.h"

namespace pliant::clickhouse {
namespace {

constexpr std::string_view kException = "Exception: ";
constexpr std::string_view kCode = "Code: ";
constexpr std::size_t kMaxDecoration = 200;  // between the code and the text
constexpr std::size_t kMaxTextBytes = 1000;

struct Meaning {
  int code;  // ErrorCodes.cpp of ClickHouse
  ErrorCode kind;
  const char* reason;
};

constexpr std::array kMeanings = {
    Meaning{60, ErrorCode::kNotFound, "database_table_missing"},        // UNKNOWN_TABLE
    Meaning{75, ErrorCode::kUnavailable, "database_outcome_unknown"},   // CANNOT_WRITE_TO_FILE...
    Meaning{81, ErrorCode::kNotFound, "database_table_missing"},        // UNKNOWN_DATABASE
    Meaning{159, ErrorCode::kUnavailable, "database_timeout"},          // TIMEOUT_EXCEEDED
    Meaning{160, ErrorCode::kUnavailable, "database_timeout"},          // TOO_SLOW
    Meaning{164, ErrorCode::kReadOnly, "database_read_only"},           // READONLY
    Meaning{173, ErrorCode::kUnavailable, "database_unavailable"},      // CANNOT_ALLOCATE_MEMORY
    Meaning{192, ErrorCode::kUnavailable, "database_login_failed"},     // UNKNOWN_USER
    Meaning{193, ErrorCode::kUnavailable, "database_login_failed"},     // WRONG_PASSWORD
    Meaning{194, ErrorCode::kUnavailable, "database_login_failed"},     // REQUIRED_PASSWORD
    Meaning{195, ErrorCode::kUnavailable, "database_login_failed"},     // IP_ADDRESS_NOT_ALLOWED
    Meaning{202, ErrorCode::kUnavailable, "database_unavailable"},      // TOO_MANY_..._QUERIES
    Meaning{209, ErrorCode::kUnavailable, "shard_unavailable"},         // SOCKET_TIMEOUT
    Meaning{210, ErrorCode::kUnavailable, "shard_unavailable"},         // NETWORK_ERROR
    Meaning{225, ErrorCode::kUnavailable, "database_unavailable"},      // NO_ZOOKEEPER
    Meaning{236, ErrorCode::kUnavailable, "database_outcome_unknown"},  // ABORTED, when it ends
    Meaning{241, ErrorCode::kUnavailable, "database_unavailable"},      // MEMORY_LIMIT_EXCEEDED
    Meaning{242, ErrorCode::kUnavailable, "database_unavailable"},      // TABLE_IS_READ_ONLY
    Meaning{243, ErrorCode::kNoSpace, "database_full"},                 // NOT_ENOUGH_SPACE
    Meaning{244, ErrorCode::kUnavailable, "database_outcome_unknown"},  // UNEXPECTED_ZOOKEEPER...
    Meaning{252, ErrorCode::kUnavailable, "database_unavailable"},      // TOO_MANY_PARTS
    Meaning{254, ErrorCode::kUnavailable, "database_unavailable"},      // NO_ACTIVE_REPLICAS
    Meaning{279, ErrorCode::kUnavailable, "shard_unavailable"},         // ALL_CONNECTION_TRIES...
    Meaning{285, ErrorCode::kUnavailable, "database_unavailable"},      // TOO_LESS_LIVE_REPLICAS
    Meaning{286, ErrorCode::kUnavailable, "database_unavailable"},      // UNSATISFIED_QUORUM...
    Meaning{319, ErrorCode::kUnavailable, "database_outcome_unknown"},  // UNKNOWN_STATUS_OF_INSERT
    Meaning{369, ErrorCode::kUnavailable, "shard_unavailable"},         // ALL_REPLICAS_ARE_STALE
    Meaning{497, ErrorCode::kReadOnly, "database_read_only"},           // ACCESS_DENIED
    Meaning{516, ErrorCode::kUnavailable, "database_login_failed"},     // AUTHENTICATION_FAILED
    Meaning{999, ErrorCode::kUnavailable, "database_unavailable"}};     // KEEPER_EXCEPTION

// The text up to what ClickHouse writes for its own developers.
std::string_view WithoutDecoration(std::string_view text) {
  for (const std::string_view mark : {", e.what() = ", ". (version ", " (version ", " Log: "}) {
    text = text.substr(0, text.find(mark));
  }
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ' || text.back() == '.')) {
    text.remove_suffix(1);
  }
  return text.substr(0, kMaxTextBytes);
}

}  // namespace

std::optional<ServerError> FindServerError(std::string_view text) {
  // A text may quote another one, of a remote server: the first one is its own.
  for (std::size_t at = text.find(kCode); at != std::string_view::npos;
       at = text.find(kCode, at + 1)) {
    ServerError error;
    const std::string_view digits = text.substr(at + kCode.size());
    const auto [end, failed] =
        std::from_chars(digits.data(), digits.data() + digits.size(), error.code);
    const std::size_t exception = digits.find(kException);
    const auto length = static_cast<std::size_t>(end - digits.data());
    if (failed != std::errc() || error.code <= 0 || exception == std::string_view::npos ||
        exception > length + kMaxDecoration ||
        digits.substr(length, exception - length).find("DB::") == std::string_view::npos) {
      continue;
    }
    error.text = WithoutDecoration(digits.substr(exception + kException.size()));
    return error;
  }
  return std::nullopt;
}

Error ToError(const ServerError& error, const std::string& host) {
  std::string text = "ClickHouse at " + host + " says: " + ToDisplayText(error.text) + " (code " +
                     std::to_string(error.code) + ")";
  if (error.text.find("errno: 28") != std::string::npos) {  // ENOSPC, in any of its calls
    return {ErrorCode::kNoSpace, "database_full", text};
  }
  for (const Meaning& meaning : kMeanings) {
    if (meaning.code == error.code) return {meaning.kind, meaning.reason, text};
  }
  return {ErrorCode::kInternal, "database_error", text};
}

}  // namespace pliant::clickhouse
