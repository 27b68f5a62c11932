// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Messages for command lines that make no sense.
#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace pliant::cli {

// For CLI::App::failure_message(): what is wrong, and the --help to read.
std::string UsageError(const CLI::App* program, const CLI::Error& error);

// "; did you mean --top?", or empty if `word` resembles none of the names.
std::string DidYouMean(const std::string& word, const std::vector<std::string>& names);

}  // namespace pliant::cli
