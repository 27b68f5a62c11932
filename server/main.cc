// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/options.h"
#include "server/service.h"

int main(int argc, char** argv) {
  const pliant::server::ParsedCommandLine parsed = pliant::server::ParseCommandLine(argc, argv);
  return parsed.finished ? parsed.exit_status : pliant::server::RunServer(parsed.options);
}
