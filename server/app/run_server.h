// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The whole server put together.
#pragma once

#include "server/app/options.h"

namespace pliant::server {

// Runs until SIGTERM or SIGINT. Returns the exit status: 0 stopped cleanly, 1 failed (also when
// requests had to be cut off at the end).
int RunServer(const ServerOptions& options);

// One line on standard output, a comment of the configuration file: how decoders are held on this
// machine.
void PrintDecoderProtection(const ServerOptions& options);

}  // namespace pliant::server
