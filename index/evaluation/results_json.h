// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Rows of the benchmarks as JSON, as `pliant eval ... --json` prints them under "results".
#pragma once

#include <vector>

#include "descriptor/evaluation/matching_benchmark.h"
#include "index/evaluation/retrieval_evaluation.h"
#include "index/json/json.h"

namespace pliant {

Json ResultsJson(const std::vector<evaluation::DescriptorResult>& results);
Json ResultJson(const RetrievalResult& row);

}  // namespace pliant
