// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The matching benchmark on a small set that is painted, simulated and measured in seconds: no
// files are needed but the committed weights.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "descriptor/evaluation/matching_benchmark.h"

namespace pliant::testing {

std::filesystem::path BaselinePath();  // tests/accuracy/baseline.json
std::filesystem::path ModelFolder();   // the committed weights and what is said of them

// The SHA-256 of each committed weight file, by the descriptor's name.
std::map<std::string, std::string> WeightHashes();

// Every descriptor. The same figures each time on one machine; on another processor rounding may
// move a few keypoints.
evaluation::MatchingReport MeasureSmallSet();

}  // namespace pliant::testing
