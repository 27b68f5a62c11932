// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What help, completion and manual say about options.
#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace pliant::cli {

// Every command below `program` with its full name ("pliant db check"), the program first.
struct NamedCommand {
  std::string path;
  const CLI::App* app;
};
std::vector<NamedCommand> AllCommands(const CLI::App& program);

// Of the commands directly below.
std::vector<std::string> CommandNames(const CLI::App& app);

// "object|image" -> object, image; empty when the values are not words.
std::vector<std::string> ValueWords(const CLI::Option& option);

bool TakesValue(const CLI::Option& option);
// What stands behind an option's name in help texts: FILE, object|image, N for numbers; empty where
// it takes no value. And "1 to 1024", or empty.
std::string ValueName(const CLI::Option& option);
std::string ValueRange(const CLI::Option& option);
// Options that begin with a dash, in the order of --help; behind them those of the command above,
// if they may stand here, too.
std::vector<const CLI::Option*> DashedOptions(const CLI::App& app);
// "--jobs", "-j"
std::vector<std::string> NamesOf(const CLI::Option& option);

}  // namespace pliant::cli
