// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The files that `pliant eval` leaves beside what it prints.
#pragma once

#include <filesystem>
#include <string>

#include "index/cli/command.h"

namespace pliant::cli {

struct EvalFiles {
  std::filesystem::path csv;   // empty = none
  std::filesystem::path plot;  // PNG or JPEG, as the name says; empty = none
};

// --csv and --plot, with what each of them does here.
void AddEvalFileFlags(CLI::App& app, EvalFiles& files, const std::string& csv_help,
                      const std::string& plot_help);

// To be called before the work. Throws what CheckPictureName and CheckWritable throw.
void CheckEvalFiles(const EvalFiles& files);

}  // namespace pliant::cli
