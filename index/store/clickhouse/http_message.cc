// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/http_message.h"

#include <algorithm>

#include "descriptor/base/error.h"
#include "index/files/text.h"

namespace pliant::clickhouse {
namespace {

constexpr std::size_t kMaxStatementInUrl = 12 * 1024;  // ClickHouse 18 takes URLs of 16 KiB

[[noreturn]] void Refuse(const std::string& what) {
  throw Error(ErrorCode::kInvalidArgument, "database_request_invalid",
              "a request to ClickHouse " + what);
}

bool IsName(const std::string& name) {
  return !name.empty() && std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
  });
}

std::string Boundary(const DatabaseRequest& request) {
  for (;;) {
    std::string boundary = "pliant" + RandomHex(32);
    const auto has = [&](const ExternalTable& table) {
      return table.rows.find(boundary) != std::string::npos;
    };
    if (std::none_of(request.tables.begin(), request.tables.end(), has)) return boundary;
  }
}

std::string FormOf(const DatabaseRequest& request, const std::string& boundary) {
  std::string body;
  for (const ExternalTable& table : request.tables) {
    // ClickHouse takes a part for a table only if it has a file name.
    body += "--" + boundary + "\r\nContent-Disposition: form-data; name=\"" + table.name +
            "\"; filename=\"" + table.name +
            "\"\r\nContent-Type: application/octet-stream\r\n\r\n" + table.rows + "\r\n";
  }
  return body + "--" + boundary + "--\r\n";
}

}  // namespace

bool IsStatement(const DatabaseRequest& request) {
  const std::size_t begin = request.statement.find_first_not_of(" \n\t(");
  if (begin == std::string::npos) return true;
  const std::string word = request.statement.substr(begin, 6);
  return word != "SELECT" && word != "select";
}

void CheckRequest(const DatabaseRequest& request) {
  if (request.statement.empty()) Refuse("has no statement");
  const bool in_url = !request.rows.empty() || !request.tables.empty();
  if (!request.rows.empty() && !request.tables.empty()) Refuse("has both rows and tables");
  if (in_url && request.statement.size() > kMaxStatementInUrl) {
    Refuse("with rows has a statement of more than " + std::to_string(kMaxStatementInUrl) +
           " bytes");
  }
  for (const ExternalTable& table : request.tables) {
    if (!IsName(table.name)) Refuse("has a table whose name is not of letters, digits and _");
  }
  for (const auto& [name, value] : request.settings) {
    if (!IsName(name)) Refuse("has a setting whose name is not of letters, digits and _");
  }
}

httplib::Request ToMessage(const DatabaseRequest& request, const HttpPoolOptions& options) {
  httplib::Request message;
  message.method = "POST";
  // Errors come before the first byte of the answer, not behind it.
  message.path = "/?wait_end_of_query=1";
  const auto add = [&message](const std::string& name, const std::string& value) {
    message.path += "&" + name + "=" + PercentEncode(value, "");
  };
  for (const auto& [name, value] : request.settings) add(name, value);
  if (!request.tables.empty()) {
    for (const ExternalTable& table : request.tables) {
      add(table.name + "_structure", table.structure);
      add(table.name + "_format", "Native");
    }
    add("query", request.statement);
    const std::string boundary = Boundary(request);
    message.body = FormOf(request, boundary);
    message.headers.emplace("Content-Type", "multipart/form-data; boundary=" + boundary);
  } else if (!request.rows.empty()) {
    add("query", request.statement);
    message.body = request.rows;
    message.headers.emplace("Content-Type", "application/octet-stream");
  } else {
    message.body = request.statement;
    message.headers.emplace("Content-Type", "text/plain; charset=UTF-8");
  }
  if (!options.user.empty()) message.headers.emplace("X-ClickHouse-User", options.user);
  if (!options.password.empty()) message.headers.emplace("X-ClickHouse-Key", options.password);
  return message;
}

bool SaysItsEnd(const httplib::Response& head) {
  const std::string coding = head.get_header_value("Transfer-Encoding");
  if (!coding.empty()) return coding == "chunked" || coding == "Chunked";
  const std::string length = head.get_header_value("Content-Length");
  return !length.empty() && length.size() < 19 &&
         std::all_of(length.begin(), length.end(), [](char c) { return c >= '0' && c <= '9'; });
}

bool WasNotSent(httplib::Error error) {
  switch (error) {
    case httplib::Error::Connection:
    case httplib::Error::ConnectionTimeout:
    case httplib::Error::SSLConnection:
    case httplib::Error::SSLLoadingCerts:
    case httplib::Error::SSLServerVerification:
      return true;
    default:
      return false;
  }
}

std::string DescribeFailure(const std::string& host, httplib::Error error, bool timed_out) {
  switch (error) {
    case httplib::Error::SSLConnection:
      return host + " does not speak TLS";
    case httplib::Error::SSLLoadingCerts:
      return "the certificates to trust cannot be loaded";
    case httplib::Error::SSLServerVerification:
      return host + " has a certificate that is not trusted, or one for another name";
    default:
      break;
  }
  if (WasNotSent(error)) return host + " cannot be reached";
  return host +
         (timed_out ? " did not answer in time" : " closed the connection without an answer");
}

}  // namespace pliant::clickhouse
