// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The matching benchmark on a small set that is painted, simulated and measured in seconds: no
// files are needed but the committed weights.
#pragma once

#include <filesystem>

#include "descriptor/evaluation/matching_benchmark.h"

namespace pliant::testing {

std::filesystem::path BaselinePath();   // tests/accuracy/baseline.json
std::filesystem::path WeightsPath();    // the committed weights
std::filesystem::path ModelCardPath();  // and what is said of them

// Every descriptor. The same figures each time on one machine; on another processor rounding may
// move a few keypoints.
evaluation::MatchingReport MeasureSmallSet();

}  // namespace pliant::testing
