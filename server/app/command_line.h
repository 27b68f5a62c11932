// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The options from flags, environment and configuration file, in that order of precedence.
#pragma once

#include <string>

#include "server/app/options.h"

namespace pliant::server {

struct ParsedCommandLine {
  ServerOptions options;
  bool finished = false;        // help, version or a usage error: the program ends with exit_status
  bool printed_config = false;  // finished, by --print-config
  int exit_status = 0;
};

// Prints help, version, or a usage error (exit status 2).
ParsedCommandLine ParseCommandLine(int argc, const char* const* argv);

// The help text, for the test that compares it with the documentation.
std::string HelpText();

}  // namespace pliant::server
