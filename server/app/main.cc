// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <string_view>

#include "descriptor/image/quiet_decoders.h"
#include "server/app/command_line.h"
#include "server/app/run_server.h"
#include "server/auth/keys_command.h"

int main(int argc, char** argv) {
  pliant::QuietDecoders();
  if (argc > 1 && std::string_view(argv[1]) == "keys") {
    return pliant::server::RunKeysCommand(argc - 1, argv + 1);
  }
  const pliant::server::ParsedCommandLine parsed = pliant::server::ParseCommandLine(argc, argv);
  return parsed.finished ? parsed.exit_status : pliant::server::RunServer(parsed.options);
}
