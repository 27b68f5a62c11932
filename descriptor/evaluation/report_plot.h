// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Draws a report: a bar chart of the table and, for a sweep, the curves.
#pragma once

#include <string>

#include "descriptor/evaluation/matching_benchmark.h"
#include "descriptor/image/image.h"

namespace pliant::evaluation {

Image PlotMatchingReport(const MatchingReport& report, const std::string& title);

}  // namespace pliant::evaluation
