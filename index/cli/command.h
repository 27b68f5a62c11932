// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The subcommands of `pliant`. Each has its own file, adds itself to the program and sets `status`;
// main reports exceptions.
#pragma once

#include <CLI/CLI.hpp>

#include "index/cli/output.h"
#include "index/usage/usage.h"

namespace pliant::cli {

void AddIndexCommand(CLI::App& program, ExitStatus& status);
void AddQueryCommand(CLI::App& program, ExitStatus& status);
void AddSelfTestCommand(CLI::App& program, ExitStatus& status);
void AddVocabCommand(CLI::App& program, ExitStatus& status);
void AddDbCommand(CLI::App& program, ExitStatus& status);
void AddDescribeCommand(CLI::App& program, ExitStatus& status);
void AddSimulateCommand(CLI::App& program, ExitStatus& status);
void AddMatchCommand(CLI::App& program, ExitStatus& status);
inline constexpr const char* kTrack = "Track an object through a video while it bends";
void AddTrackCommand(CLI::App& program, ExitStatus& status);
// The benchmarks of `pliant eval`.
void AddEvalMatching(CLI::App& eval, ExitStatus& status);
void AddEvalRetrieval(CLI::App& eval, ExitStatus& status);
inline constexpr const char* kEvalTracking =
    "Track simulated objects with ground truth (simulate --preset sequence)";
void AddEvalTracking(CLI::App& eval, ExitStatus& status);

}  // namespace pliant::cli
