// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The whole server.
#pragma once

#include "server/app/options.h"

namespace pliant::server {

// Runs until SIGTERM or SIGINT. Returns the exit status: 0 = clean stop, 1 = failed, or cut off
// requests at the end. Logs to standard error.
int RunServer(const ServerOptions& options);

// Prints a comment of the configuration file: how this machine isolates decoders.
void PrintDecoderProtection(const ServerOptions& options);

}  // namespace pliant::server
