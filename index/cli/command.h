// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The subcommands of `pliant`. Each has its own file, adds itself to the program and sets `status`;
// main reports exceptions.
#pragma once

#include <map>
#include <string>

#include <CLI/CLI.hpp>

#include "index/cli/exit_status.h"

namespace pliant::cli {

void AddIndexCommand(CLI::App& program, ExitStatus& status);
void AddQueryCommand(CLI::App& program, ExitStatus& status);
void AddVocabCommand(CLI::App& program, ExitStatus& status);
void AddDbCommand(CLI::App& program, ExitStatus& status);
void AddDescribeCommand(CLI::App& program, ExitStatus& status);
void AddSimulateCommand(CLI::App& program, ExitStatus& status);
void AddMatchCommand(CLI::App& program, ExitStatus& status);
void AddEvalCommand(CLI::App& program, ExitStatus& status);
void AddTrackCommand(CLI::App& program, ExitStatus& status);
// The benchmarks of `pliant eval`.
void AddEvalMatching(CLI::App& eval, ExitStatus& status);
void AddEvalRetrieval(CLI::App& eval, ExitStatus& status);
void AddEvalTracking(CLI::App& eval, ExitStatus& status);

// An option whose values are the names in `choices`; `names` lists them for --help.
template <typename Enum>
void AddChoice(CLI::App& app, const std::string& name, Enum& value, const std::string& help,
               const std::map<std::string, Enum>& choices, const std::string& names) {
  app.add_option(name, value, help)
      ->transform(CLI::CheckedTransformer(choices))
      ->option_text(names);
}

}  // namespace pliant::cli
