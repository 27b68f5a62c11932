// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The matching benchmark's report as text, JSON and CSV.
#pragma once

#include <string>

#include "descriptor/evaluation/matching_benchmark.h"
#include "index/json/json.h"

namespace pliant::cli {

// Tables for people: all pairs, then each group, then the curve.
std::string MatchingReportText(const evaluation::MatchingReport& report);

// One document: {"pairs", "left_out", "layout", "keypoints", "tolerance_px", "results": [...],
// "groups": [...], "curves": [...]}.
Json MatchingReportJson(const evaluation::MatchingReport& report,
                        const evaluation::MatchingOptions& options);

// Columns set (all, a group's name, or the sweep's), value (of the sweep), descriptor, figures.
std::string MatchingReportCsv(const evaluation::MatchingReport& report);

}  // namespace pliant::cli
