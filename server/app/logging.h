// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The log on standard error: text lines, or one JSON object per line.
#pragma once

#include "server/app/options.h"
#include "server/http/http_server.h"

namespace pliant::server {

void StartLog(const ServerOptions& options);

// One line per request. No key, no query, no content.
void LogRequest(const RequestRecord& record);

}  // namespace pliant::server
