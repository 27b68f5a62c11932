// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The optional output files of `pliant eval`.
#pragma once

#include <filesystem>
#include <string>

#include "index/cli/command.h"

namespace pliant::cli {

struct EvalFiles {
  std::filesystem::path csv;   // empty = none; - = standard output
  std::filesystem::path plot;  // PNG or JPEG, by file name; empty, - as above
};

// --csv and --plot, with their help texts.
void AddEvalFileFlags(CLI::App& app, EvalFiles& files, const std::string& csv_help,
                      const std::string& plot_help);

// A row of a table: [LABEL:]NAME[=WEIGHTS]. The error names the descriptor that was probably meant.
CLI::Validator KnownDescriptorChoice();

// To be called before the evaluation. `json`: a document is printed, too. Throws what
// CheckPictureName, CheckWritable and ClaimStandardOutput throw.
void CheckEvalFiles(const EvalFiles& files, bool json);

}  // namespace pliant::cli
