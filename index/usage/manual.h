// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A manual page, made from the options that the program has.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace pliant::cli {

// For man(7), section 1: the program, its commands and what --help says of each.
std::string ManualPage(const CLI::App& program, const std::string& version);

}  // namespace pliant::cli
