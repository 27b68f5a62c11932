// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A request to ClickHouse as an HTTP message.
#pragma once

#include <string>

#include <httplib.h>

#include "index/store/clickhouse/http_pool.h"

namespace pliant::clickhouse {

// Throws kInvalidArgument "database_request_invalid".
void CheckRequest(const DatabaseRequest& request);

// Something that answers with nothing: an INSERT, not a SELECT.
bool IsStatement(const DatabaseRequest& request);

httplib::Request ToMessage(const DatabaseRequest& request, const HttpPoolOptions& options);

// Its head has the length of the body, or announces pieces: one that is cut short is noticed.
bool SaysItsEnd(const httplib::Response& head);

// The statement has certainly not reached the server.
bool WasNotSent(httplib::Error error);
std::string DescribeFailure(const std::string& host, httplib::Error error, bool timed_out);

}  // namespace pliant::clickhouse
