// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How --help shows an option: "-j,--jobs N    threads (0 to 1024; default: 0)", and not
// "-j,--jobs INT:INT in [0 - 1024]=0    threads"; and, of a command that takes those of the command
// above it, also these.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace pliant::cli {

class HelpFormat : public CLI::Formatter {
 public:
  std::string make_option_opts(const CLI::Option* option) const override;
  std::string make_option_desc(const CLI::Option* option) const override;
  std::string make_footer(const CLI::App* app) const override;
};

}  // namespace pliant::cli
