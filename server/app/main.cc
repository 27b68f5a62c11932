// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <string_view>

#include "descriptor/base/reuse_memory.h"
#include "server/app/run_server.h"
#include "server/auth/keys_command.h"
#include "server/decoder/decoder_main.h"

int main(int argc, char** argv) {
  pliant::ReuseMemory();
  if (pliant::server::IsDecoder(argc, argv)) return pliant::server::RunDecoder(argc, argv);
  if (argc > 1 && std::string_view(argv[1]) == "keys") {
    return pliant::server::RunKeysCommand(argc - 1, argv + 1);
  }
  const pliant::server::ParsedCommandLine parsed = pliant::server::ParseCommandLine(argc, argv);
  if (parsed.printed_config) pliant::server::PrintDecoderProtection(parsed.options);
  return parsed.finished ? parsed.exit_status : pliant::server::RunServer(parsed.options);
}
