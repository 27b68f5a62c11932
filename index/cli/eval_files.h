// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Flags that the benchmarks of `pliant eval` share.
#pragma once

#include <filesystem>
#include <string>

#include "index/cli/command.h"

namespace pliant::cli {

// --csv, with its help text; empty = none; - = standard output.
void AddCsvFlag(CLI::App& app, std::filesystem::path& csv, const std::string& help);

// A row of a table: [LABEL:]NAME[=WEIGHTS]. The error names the descriptor that was probably meant.
CLI::Validator KnownDescriptorChoice();

// Call it before the evaluation. `json`: a document is printed, too. Throws what CheckWritable and
// ClaimStandardOutput throw.
void CheckCsv(const std::filesystem::path& csv, bool json);

}  // namespace pliant::cli
