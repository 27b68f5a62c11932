// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Completion scripts for shells, made from the options that the program has.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace pliant::cli {

// `shell`: bash, zsh or fish; throws Error kInvalidArgument "bad_shell" otherwise. Commands,
// options and those values that are words are completed, and files elsewhere.
std::string CompletionScript(const CLI::App& program, const std::string& shell);

}  // namespace pliant::cli
