// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The optional output files of `pliant eval`.
#pragma once

#include <filesystem>
#include <string>

#include "index/cli/command.h"

namespace pliant::cli {

struct EvalFiles {
  std::filesystem::path csv;   // empty = none
  std::filesystem::path plot;  // PNG or JPEG, by file name; empty = none
};

// --csv and --plot, with their help texts.
void AddEvalFileFlags(CLI::App& app, EvalFiles& files, const std::string& csv_help,
                      const std::string& plot_help);

// To be called before the evaluation. Throws what CheckPictureName and CheckWritable throw.
void CheckEvalFiles(const EvalFiles& files);

}  // namespace pliant::cli
