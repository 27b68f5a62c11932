// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Starting a program as a decoder. Private to decoder/.
#pragma once

#include "server/decoder/decoder_process.h"

namespace pliant::server {

struct StartedDecoder {
  pid_t id = -1;
  int socket = -1;  // ours, not blocking
};

// The program with an empty environment and no open file but its socket; SIGINT and SIGTERM, which
// a terminal or a service manager sends to all processes, do not reach it. Throws Error
// kUnavailable "decoder_not_started".
StartedDecoder StartDecoder(const DecoderOptions& options);

}  // namespace pliant::server
