// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What is said when a command line makes no sense.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace pliant::cli {

// For CLI::App::failure_message(): one or two lines, with the command, option or value that was
// probably meant.
std::string UsageError(const CLI::App* program, const CLI::Error& error);

}  // namespace pliant::cli
