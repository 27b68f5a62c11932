// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The log on standard error: lines for people, or a JSON object a line.
#pragma once

#include "server/app/options.h"
#include "server/http/http_server.h"

namespace pliant::server {

void StartLog(const ServerOptions& options);

// One line a request. No key, no query, no content.
void LogRequest(const RequestRecord& record);

}  // namespace pliant::server
